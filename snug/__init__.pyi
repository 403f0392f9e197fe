from .body.parametric_body import Body as Body
from .garments.garment import Garment as Garment
from .motion.motion import Motion as Motion
from .networks.dressed_body import DressedBody as DressedBody
from .networks.roll_out import roll_out as roll_out
from .networks.trained_model import TrainedModel as TrainedModel
from .training.train_network import train_network as train_network

__all__ = [
    "Body",
    "DressedBody",
    "Garment",
    "Motion",
    "TrainedModel",
    "roll_out",
    "train_network",
]
