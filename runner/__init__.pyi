from .analysis import analyze as analyze
from .files import InputError as InputError
from .files import to_pandas as to_pandas
from .files import to_polars as to_polars
from .run import simulate as simulate
from .scenario import load_scenario as load_scenario
from .scenario import without_code as without_code
from .sweep import batch as batch
