"""Facts that follow from a problem, derived once for as long as it lives."""

from collections.abc import Callable
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

from perfplast_fenicsx.problem.problem import Problem

T = TypeVar("T")


def once_a_problem(derive: Callable[[Problem], T]) -> Callable[[Problem], T]:
    """Let a function of a problem be called once for each.

    A problem's mesh, its declaration and its contact never change. Whoever asks gets the same
    arrays, which nobody writes to.

    Args:
        derive: Arrays that do not refer to the problem, which would live on with them.
    """
    known: WeakKeyDictionary[Problem, T] = WeakKeyDictionary()

    @wraps(derive)
    def derived(problem: Problem) -> T:
        if problem not in known:
            known[problem] = derive(problem)
        return known[problem]

    return derived
