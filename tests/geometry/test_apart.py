"""Test that the program names bodies that touch no other body."""

import pytest

from perfplast_fenicsx.geometry.mesher import apart_remarks, groups_of
from perfplast_fenicsx.geometry.survey import Joint

pytestmark = pytest.mark.serial


def joint(one: str, other: str) -> Joint:
    return Joint((one, other), (f"{one}_joint", f"{other}_joint"), 1.0, ("flat",))


def test_groups_of_bodies() -> None:
    joints = [joint("a", "c"), joint("b", "d"), joint("c", "d")]
    assert groups_of("abcde", joints) == [["a", "c", "b", "d"], ["e"]]
    (remark,) = apart_remarks("abcde", joints)
    assert remark.startswith("'a' with 'c' with 'b' with 'd', 'e' do not touch each other")
    assert "--without e" in remark


def test_bodies_that_touch() -> None:
    assert not list(apart_remarks("abc", [joint("a", "b"), joint("c", "b")]))
    assert not list(apart_remarks(["a"], []))


def test_many_bodies_are_not_all_named() -> None:
    (remark,) = apart_remarks([f"b{k}" for k in range(20)], [])
    assert "'b7' and 12 more do not touch" in remark
    assert "b8" not in remark
