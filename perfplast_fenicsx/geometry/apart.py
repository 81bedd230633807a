"""Bodies that touch no other one, of which each has to be held."""

from collections.abc import Iterator, Sequence

from perfplast_fenicsx.geometry.survey import Joint


def groups_of(bodies: Sequence[str], joints: Sequence[Joint]) -> list[list[str]]:
    """Return bodies that touch, directly or by way of others, in the order of the bodies."""
    group = {body: [body] for body in bodies}
    for joint in joints:
        one, other = (group[body] for body in joint.bodies)
        if one is not other:
            one += other
            group.update(dict.fromkeys(other, one))
    return list({id(members): members for members in group.values()}.values())


def apart_remarks(bodies: Sequence[str], joints: Sequence[Joint]) -> Iterator[str]:
    """That bodies do not touch, in a sentence, if they do not."""
    groups = groups_of(bodies, joints)
    if len(groups) < 2:
        return
    most_names = 8  # so many bodies are named at most
    names = ["'" + "' with '".join(group) + "'" for group in groups[:most_names]]
    rest = f" and {len(groups) - most_names} more" if len(groups) > most_names else ""
    yield (
        f"{', '.join(names)}{rest} do not touch each other: each wants supports and loads of its"
        f" own, or is left out (--without {groups[-1][0]})"
    )
