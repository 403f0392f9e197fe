from .command_line import Parser as Parser
from .command_line import command as command

__all__ = ["Parser", "command"]
