from .body.parametric_body import Body as Body
from .body.skinning import skin as skin
from .body.smpl_files import read_body as read_body
from .file_options import GarmentFile as GarmentFile
from .garments.garment import Garment as Garment
from .garments.reading import read_garment as read_garment
from .garments.templates import GARMENT_TEMPLATES as GARMENT_TEMPLATES
from .garments.templates import find_template as find_template
from .motion.files import load_motions as load_motions
from .motion.library import LIBRARY as LIBRARY
from .motion.library import make_motion as make_motion
from .motion.motion import Motion as Motion
from .named_recipes import RECIPES as RECIPES
from .networks.dressed_body import DressedBody as DressedBody
from .networks.roll_out import roll_out as roll_out
from .networks.trained_model import TrainedModel as TrainedModel
from .recipe import Recipe as Recipe
from .training.train_network import train_network as train_network

__all__ = [
    "GARMENT_TEMPLATES",
    "LIBRARY",
    "RECIPES",
    "Body",
    "DressedBody",
    "Garment",
    "GarmentFile",
    "Motion",
    "Recipe",
    "TrainedModel",
    "find_template",
    "load_motions",
    "make_motion",
    "read_body",
    "read_garment",
    "roll_out",
    "skin",
    "train_network",
]
