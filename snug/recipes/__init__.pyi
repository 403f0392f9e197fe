from .energies import find_energy as find_energy
from .named import RECIPES as RECIPES
from .named import find_recipe as find_recipe
from .recipe import DEFAULT as DEFAULT
from .recipe import Recipe as Recipe
from .recipe import RecipeError as RecipeError

__all__ = [
    "DEFAULT",
    "RECIPES",
    "Recipe",
    "RecipeError",
    "find_energy",
    "find_recipe",
]
