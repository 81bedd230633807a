"""Find groups of bodies that do not touch each other, each of which needs supports."""

from collections.abc import Iterator, Sequence

from perfplast_fenicsx.geometry.survey import Joint


def groups_of(bodies: Sequence[str], joints: Sequence[Joint]) -> list[list[str]]:
    """Return groups of bodies connected by contact, in the order of the bodies."""
    group = {body: [body] for body in bodies}
    for joint in joints:
        one, other = (group[body] for body in joint.bodies)
        if one is not other:
            one += other
            group.update(dict.fromkeys(other, one))
    return list({id(members): members for members in group.values()}.values())


def apart_remarks(bodies: Sequence[str], joints: Sequence[Joint]) -> Iterator[str]:
    """Yield a sentence that bodies do not touch, if they do not."""
    groups = groups_of(bodies, joints)
    if len(groups) < 2:
        return
    most_names = 8  # largest number of bodies that are named
    names = ["'" + "' with '".join(group) + "'" for group in groups[:most_names]]
    rest = f" and {len(groups) - most_names} more" if len(groups) > most_names else ""
    yield (
        f"{', '.join(names)}{rest} do not touch each other: give each its own supports and "
        f"loads, or leave it out (--without {groups[-1][0]})"
    )
