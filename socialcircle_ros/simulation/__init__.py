# SPDX-License-Identifier: Apache-2.0
"""A virtual focus-variation instrument: stacks and clouds with a known truth.

There are two ways to a cloud with known outliers:

- `make_scene` adds outliers to a surface, in a given number, kind and place.
- `simulate` renders a focus stack frame by frame. Its outliers are caused by glints, darkness, steepness, lack of
  texture and camera noise, when its depth is measured.

Recordings and ROS messages are made elsewhere, from what these functions return.
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
