from pathlib import Path
from .formats import merl
def load(what): return merl.read(Path(what))
