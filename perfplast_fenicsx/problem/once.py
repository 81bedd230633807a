"""Cache values that are derived from a problem for the lifetime of the problem."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from perfplast_fenicsx.problem.problem import Problem

T = TypeVar("T")


def once_a_problem(derive: Callable[[Problem], T]) -> Callable[[Problem], T]:
    """Return a function that evaluates ``derive`` only once for each problem.

    The mesh, the declaration and the contact of a problem never change. All callers receive the
    same arrays, and no caller may write to them.

    Args:
        derive: Function of a problem. Its result must not refer to the problem, because the
            cached result would then keep the problem alive.
    """
    known: WeakKeyDictionary[Problem, T] = WeakKeyDictionary()

    @wraps(derive)
    def derived(problem: Problem) -> T:
        if problem not in known:
            known[problem] = derive(problem)
        return known[problem]

    return derived
