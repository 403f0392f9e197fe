from .garment import Garment as Garment
from .garment import GarmentError as GarmentError
from .garment import smooth_weights as smooth_weights
from .options import GarmentFile as GarmentFile
from .reading import read_garment as read_garment
from .templates import GARMENT_TEMPLATES as GARMENT_TEMPLATES
from .templates import find_template as find_template
from .templates import tailor_dress as tailor_dress
from .templates import tailor_long_sleeves as tailor_long_sleeves
from .templates import tailor_shorts as tailor_shorts
from .templates import tailor_skirt as tailor_skirt
from .templates import tailor_tank_top as tailor_tank_top
from .templates import tailor_trousers as tailor_trousers
from .templates import tailor_tshirt as tailor_tshirt
from .templates import tailor_tunic as tailor_tunic

__all__ = [
    "GARMENT_TEMPLATES",
    "Garment",
    "GarmentError",
    "GarmentFile",
    "find_template",
    "read_garment",
    "smooth_weights",
    "tailor_dress",
    "tailor_long_sleeves",
    "tailor_shorts",
    "tailor_skirt",
    "tailor_tank_top",
    "tailor_trousers",
    "tailor_tshirt",
    "tailor_tunic",
]
