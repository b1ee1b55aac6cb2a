from .runner import InputError as InputError
from .runner import analyze as analyze
from .runner import batch as batch
from .runner import load_scenario as load_scenario
from .runner import simulate as simulate
from .runner import without_code as without_code
from .runner.version import __version__ as __version__
