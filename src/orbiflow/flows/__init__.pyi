from .flow import Flow as Flow
from .integrators import METHODS as METHODS
from .integrators import RungeKutta as RungeKutta
from .integrators import method as method
from .storage import flow_from as flow_from
from .storage import flow_parts as flow_parts
from .storage import load_flow as load_flow
from .storage import save_flow as save_flow
