# SPDX-License-Identifier: Apache-2.0
"""The ament_python package: metadata, entry points and data files."""

from pathlib import Path

from setuptools import find_packages, setup

NAME = 'socialcircle_ros'
HERE = Path(__file__).resolve().parent

# ROS 2 Jazzy's client library as wheels, for a machine without Jazzy's own packages.
ROS = [
    'ros-jazzy-rclpy==7.1.6',
    'ros-jazzy-common-interfaces==5.3.6',
    'ros-jazzy-rmw-fastrtps-cpp==8.4.3',
    'ros-jazzy-ament-index-python==1.8.1',
]
KILTED = [
    'ros-kilted-rclpy==9.1.2',
    'ros-kilted-common-interfaces==5.5.1',
    'ros-kilted-rmw-fastrtps-cpp==9.3.3',
    'ros-kilted-ament-index-python==1.11.0',
]
PICTURES = ['matplotlib>=3.6', 'Pillow>=9', 'Jinja2>=3.1']  # pictures, and the pages that show them
TUNING = ['optuna>=4']
FORMATS = ['SurfaceTopography>=1.20', *PICTURES]  # files of instruments
MEASUREMENTS = ['pyarrow>=14', 'duckdb>=1.1']
BATCH = ['dask>=2024.1', 'distributed>=2024.1', 'fsspec>=2024.1', 'bokeh>=3.4', *MEASUREMENTS, *PICTURES]
# The training of the network of the adaptive mode.
TRAIN = ['torch>=2.2', 'onnx>=1.15', 'scipy>=1.11', *PICTURES]
PANEL = ['viser>=1.1,<2', 'websockets>=13', *PICTURES]
BASE_TEST = [
    'pytest>=7.4',
    'pytest-xdist>=3.4',
    'hypothesis>=6.98',
    'rosbags>=0.10.4',
    'mcap-ros2-support>=0.5',
]
TEST = [
    *BASE_TEST,
    's3fs>=2024.1',  # an object store, and a server that answers as one
    'moto[server]>=5',
    'playwright>=1.40',  # drives the system's Chromium; brings no browser of its own
]
SITE = ['sphinx>=7', 'myst-parser>=3', 'furo']  # the documents as a site
LINT = ['ruff==0.17.6', 'mypy==2.4.1', 'types-PyYAML']


def shared(folder: str, pattern: str) -> tuple[str, list[str]]:
    """Files of `folder` to be installed under share/, as setuptools wants them: relative."""
    files = sorted(path for path in (HERE / folder).glob(pattern) if path.is_file())
    return f'share/{NAME}/{folder}', [str(path.relative_to(HERE)) for path in files]


setup(
    name=NAME,
    version='0.2.0',
    description='Outlier removal for organized point clouds of optical microscopes, in ROS 2',
    long_description=(HERE / 'README.md').read_text(encoding='utf-8'),
    long_description_content_type='text/markdown',
    license='Apache-2.0',
    maintainer='socialcircle_ros maintainers',
    maintainer_email='maintainers@socialcircle.dev',
    packages=find_packages(include=[NAME, f'{NAME}.*']),
    package_data={
        NAME: [
            'py.typed',
            'node/*.xml',
            'recording/definitions/*',
            'panel/*.css',
            'report/templates/*',
            'circle/network/*.onnx',
        ]
    },
    data_files=[
        ('share/ament_index/resource_index/packages', [f'resource/{NAME}']),
        (f'share/{NAME}', ['package.xml']),
        (f'lib/{NAME}', ['scripts/tune']),  # for ros2 run
        shared('launch', '*.launch.py'),
        shared('config', '*.yaml'),
        shared('config', '*.xml'),
        shared('viewers', '*'),
        shared('bags', 'stack.yaml'),
        shared('bags', '*.mcap'),
    ],
    python_requires='>=3.10',
    install_requires=[
        'setuptools',
        'numpy>=1.26',
        'numba>=0.58',
        'onnxruntime>=1.17',  # the network that decides in the adaptive mode
        'mcap>=1.2.1',
        'lz4>=4',
        'zstandard>=0.21',
        'PyYAML>=6',
        'click>=8.1',
        'rich>=13.3.3',  # as viser needs it
    ],
    extras_require={
        'ros': ROS,
        'kilted': KILTED,  # in an environment without the extra ros
        'pictures': PICTURES,
        'tuning': [*TUNING, *PICTURES],
        'panel': PANEL,
        'formats': FORMATS,
        'train': TRAIN,
        'measurements': MEASUREMENTS,
        'batch': BATCH,
        'site': SITE,
        'base-test': BASE_TEST,  # for tests of the base install
        'test': [*TEST, *PANEL, *TUNING, *BATCH],
        'dev': [*TEST, *PANEL, *TUNING, *BATCH, *SITE, *LINT],
    },
    zip_safe=True,
    entry_points={
        'console_scripts': [
            'socialcircle = socialcircle_ros.commands.main:main',
            'social_circle_node = socialcircle_ros.node.main:main',
        ],
    },
)
