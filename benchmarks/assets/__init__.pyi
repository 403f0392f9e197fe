from .assets import Assets as Assets
from .assets import embedded_motions as embedded_motions
from .assets import open_assets as open_assets
from .inputs import Inputs as Inputs
from .inputs import read_inputs as read_inputs

__all__ = ["Assets", "Inputs", "embedded_motions", "open_assets", "read_inputs"]
