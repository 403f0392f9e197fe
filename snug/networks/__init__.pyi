from .architectures import ARCHITECTURES as ARCHITECTURES
from .architectures import make_network as make_network
from .dressed_body import DressedBody as DressedBody
from .garment_network import GarmentNetwork as GarmentNetwork
from .roll_out import RollOutError as RollOutError
from .trained_model import ModelFileError as ModelFileError
from .trained_model import TrainedModel as TrainedModel

__all__ = [
    "ARCHITECTURES",
    "DressedBody",
    "GarmentNetwork",
    "ModelFileError",
    "RollOutError",
    "TrainedModel",
    "make_network",
]
