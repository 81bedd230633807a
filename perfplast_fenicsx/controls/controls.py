"""List the controls that case files may name."""

from perfplast_fenicsx.controls.bounds_control import BoundsControl
from perfplast_fenicsx.controls.control import Control
from perfplast_fenicsx.controls.displacement_control import DisplacementControl
from perfplast_fenicsx.controls.envelope_control import EnvelopeControl
from perfplast_fenicsx.controls.load_control import LoadControl
from perfplast_fenicsx.controls.seismic_control import SeismicControl
from perfplast_fenicsx.controls.shakedown_control import ShakedownControl
from perfplast_fenicsx.controls.strength_control import StrengthControl
from perfplast_fenicsx.controls.work_control import WorkControl

CONTROLS: dict[str, type[Control]] = {
    "load": LoadControl,
    "displacement": DisplacementControl,
    "work": WorkControl,
    "bounds": BoundsControl,
    "strength": StrengthControl,
    "seismic": SeismicControl,
    "envelope": EnvelopeControl,
    "shakedown": ShakedownControl,
}
"""Control classes by the value of ``control``; their fields are the other keys of ``[loading]``."""
