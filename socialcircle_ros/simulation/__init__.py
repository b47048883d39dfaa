"""A virtual focus-variation instrument: stacks and clouds with known truth.

Two ways to a cloud whose outliers are known:

- `make_scene`: outliers painted onto a surface, in any number, kind and place;
- `simulate`: a focus stack rendered frame by frame, whose outliers come out of glints, darkness, steepness,
  lack of texture and the camera's noise, once a depth is looked for in it.

Neither knows of recordings or of ROS.
"""

from .camera import NOISELESS, Camera
from .instrument import Simulation, StackFrame, simulate
from .optics import INSTRUMENTS, Optics
from .outliers import Contaminated, Contamination, add_outliers
from .scenes import SCENES, Scene, make_scene
from .specimen import MATERIALS, Glints, Material, Specimen, make_specimen
from .stage import Stage, Travel
from .surfaces import Grid
from .truth import Cause, DepthTruth, PixelVerdict

__all__ = [
    'INSTRUMENTS',
    'MATERIALS',
    'NOISELESS',
    'SCENES',
    'Camera',
    'Cause',
    'Contaminated',
    'Contamination',
    'DepthTruth',
    'Glints',
    'Grid',
    'Material',
    'Optics',
    'PixelVerdict',
    'Scene',
    'Simulation',
    'Specimen',
    'StackFrame',
    'Stage',
    'Travel',
    'add_outliers',
    'make_scene',
    'make_specimen',
    'simulate',
]
