"""Cache values that follow from a problem for the lifetime of the problem."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from perfplast_fenicsx.problem.problem import Problem

T = TypeVar("T")


def once_a_problem(derive: Callable[[Problem], T]) -> Callable[[Problem], T]:
    """Return a function of a problem that is evaluated once for each problem.

    A problem's mesh, its declaration and its contact never change. All callers receive the same
    arrays, which no caller may write to.

    Args:
        derive: Function of a problem. Its arrays must not refer to the problem, which they would
            keep alive.
    """
    known: WeakKeyDictionary[Problem, T] = WeakKeyDictionary()

    @wraps(derive)
    def derived(problem: Problem) -> T:
        if problem not in known:
            known[problem] = derive(problem)
        return known[problem]

    return derived
