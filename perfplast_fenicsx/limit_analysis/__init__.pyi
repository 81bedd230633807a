from .discrete_limit import DiscreteLimit as DiscreteLimit
from .discrete_limit import InteriorStep as InteriorStep
from .discrete_limit import Verdict as Verdict
from .discrete_limit import interior_point as interior_point
from .kinematic_bound import dissipation_bound as dissipation_bound
from .limit_search import LimitLoad as LimitLoad
from .limit_search import collapse_mechanism as collapse_mechanism
from .limit_search import limit_load as limit_load
