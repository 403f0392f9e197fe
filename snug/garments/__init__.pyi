from .garment import Garment as Garment
from .garment import GarmentError as GarmentError
from .garment import smooth_weights as smooth_weights
from .options import GarmentFile as GarmentFile
from .reading import read_garment as read_garment
from .templates import GARMENT_TEMPLATES as GARMENT_TEMPLATES
from .templates import GarmentTemplate as GarmentTemplate
from .templates import find_template as find_template

__all__ = [
    "GARMENT_TEMPLATES",
    "Garment",
    "GarmentError",
    "GarmentFile",
    "GarmentTemplate",
    "find_template",
    "read_garment",
    "smooth_weights",
]
