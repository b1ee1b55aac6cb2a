from .proof import Proof as Proof
from .proof import disturbance as disturbance
from .proof import proof_of as proof_of
from .proof import proof_reaches as proof_reaches
from .proof import signals_along as signals_along
from .reaching import reaching_law as reaching_law
