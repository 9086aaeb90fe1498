"""Build with colcon (ament_python) or with pip; package.xml lists what ROS provides."""

from glob import glob
from pathlib import Path

from setuptools import Distribution, find_packages, setup

NAME = "cardbox_tracker"
SHARE = f"share/{NAME}"
HOME = "https://github.com/cardbox-tracker/cardbox_tracker"

# A ROS installation has these, so pip installs them only on request.
ROS = ["ros-jazzy-rclpy[fastrtps]", "ros-jazzy-common-interfaces"]
# 'cardbox track FOLDER --scheduler' on a cluster.
CLUSTER = ["dask>=2024.5", "distributed>=2024.5"]
# Streams to programs that teleoperate robots.
TELEOPERATION = ["msgpack>=1,<2", "python-osc>=1.8,<2", "pyzmq>=25,<28"]
# The robots of lab/tools/pick_and_place.py.
SIMULATION = ["mujoco>=4,<5"]
# Gives results in memory as a table.
PANDAS = ["pandas>=2,<4"]
TEST = [
    "bvh>=0.3,<1",
    "catkin_pkg>=1.0",
    "cma>=4,<5",
    *CLUSTER,
    "hypothesis>=6.100",
    "mcap>=1.2",
    "mcap-ros2-support>=0.5.4",
    "mypy>=1.11",
    *PANDAS,
    "pytest>=7.4",
    "pytest-timeout>=2.3",
    "pytest-xdist>=3.5",
    "ruff>=0.6",
    *TELEOPERATION,
    "types-PyYAML",
    "types-tqdm",
    "yourdfpy>=0.0.56",
]
# The viewer, 170 MB; its interface changes with each minor version.
VIEW = ["rerun-sdk>=0.41,<0.42"]
# Writes tables of results in Parquet; what is used of it has not changed for many versions.
PARQUET = ["pyarrow>=15,<30"]
# Writes results as C3D; the other formats of 'cardbox export' need no library.
EXPORT = ["ezc3d>=1.5,<2"]
# Runs the networks of the person detector; 'cardbox detector --install' gets their files.
DETECTOR = ["ai-edge-litert>=1.4,<3"]
# Builds the site of the documents.
DOCS = ["furo>=2024.5", "myst-parser>=3,<6", "sphinx>=7.3,<10", "sphinxcontrib-mermaid>=0.9,<3"]
# Newer setuptools lack 'setup.py develop', which 'colcon build --symlink-install' calls.
COLCON = ["colcon-common-extensions>=0.3", "setuptools>=70.1,<80"]

# 'ros2 run' and launch look for executables in lib/NAME, pip puts them into bin/.
TO_BIN = """#!/bin/sh
exec "$(dirname "$0")/../../bin/$(basename "$0")" "$@"
"""


class InstallData(Distribution().get_command_class("install_data")):
    """In a wheel, also install a script in lib/NAME for each executable that pip puts into bin/."""

    def run(self):
        """Install the data; colcon puts the executables themselves into lib/NAME."""
        super().run()
        if self.distribution.get_command_obj("bdist_wheel", create=False) is None:
            return
        folder = Path(self.install_dir, "lib", NAME)
        folder.mkdir(parents=True, exist_ok=True)
        for script in SCRIPTS:
            path = folder / script.split(" = ")[0]
            path.write_text(TO_BIN)
            path.chmod(0o755)
            self.outfiles.append(str(path))


SCRIPTS = [
    f"cardbox = {NAME}.start:cardbox",
    f"background = {NAME}.start:background",
    f"initializer = {NAME}.start:initializer",
    f"tracker = {NAME}.start:tracker",
    f"camera = {NAME}.start:camera",
    f"play_bag = {NAME}.start:play_bag",
    f"detector = {NAME}.start:detector",
    f"stereo_depth = {NAME}.start:stereo_depth",
    f"rula = {NAME}.start:rula",
    f"retarget = {NAME}.start:retarget",
    f"teleoperation = {NAME}.start:teleoperation",
    f"cardbox_nodes = {NAME}.start:cardbox_nodes",
]

setup(
    name=NAME,
    version="0.1.0",
    description="Upper-body posture of one person from silhouettes of one or more fixed cameras",
    maintainer="cardbox_tracker maintainers",
    maintainer_email="maintainers@cardbox-tracker.invalid",
    license="Apache-2.0",
    url=HOME,
    project_urls={"Source": HOME, "Tracker": f"{HOME}/issues"},
    classifiers=[
        "Development Status :: 4 - Beta",
        "Intended Audience :: Developers",
        "Intended Audience :: Science/Research",
        "Operating System :: POSIX :: Linux",
        "Programming Language :: Python :: 3",
        "Programming Language :: Python :: 3.11",
        "Programming Language :: Python :: 3.12",
        "Programming Language :: Python :: 3.13",
        "Programming Language :: Python :: 3.14",
        "Topic :: Scientific/Engineering :: Image Recognition",
        "Typing :: Typed",
    ],
    packages=find_packages(include=[NAME, f"{NAME}.*"]),
    package_data={
        f"{NAME}.applications.demo": ["film.mp4", "film.npz", "film.txt"],
        f"{NAME}.applications.ergonomics": ["*.html"],
        f"{NAME}.applications.reporting": ["*.html"],
        NAME: ["py.typed"],
        f"{NAME}.common": ["*.csv"],
        f"{NAME}.ros": ["*.csv"],
        f"{NAME}.search": ["*.json"],
        f"{NAME}.terms": ["*.json"],
        f"{NAME}.tracking": ["*.json"],
    },
    zip_safe=False,
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (SHARE, ["package.xml"]),
        (f"{SHARE}/config", sorted(glob("config/*"))),
        (f"{SHARE}/launch", sorted(glob("launch/*.launch.py"))),
    ],
    python_requires=">=3.11",
    # The upper bound is the next version that may break the interface: a major one, but a minor
    # one of rosbags, whose interface still changes.
    install_requires=[
        "av>=13,<19",
        "jinja2>=3.1,<4",
        "joblib>=1.3,<2",
        "lz4>=4.3,<5",
        "matplotlib>=3.8,<4",
        # common/compiling.py calls what is inside numba, which other minor versions may change.
        "numba>=0.60,<0.69",
        "numpy>=1.26,<3",
        "opencv-python-headless>=4.9,<6",
        "pillow>=10,<14",
        "PyYAML>=6.0,<7",
        "rosbags>=0.10,<0.12",
        "scipy>=1.11,<2",
        "tqdm>=4.66,<5",
    ],
    extras_require={
        "ros": ROS,
        "test": TEST,
        "colcon": COLCON,
        "view": VIEW,
        "detector": DETECTOR,
        "pandas": PANDAS,
        "parquet": PARQUET,
        "docs": DOCS,
        "export": EXPORT,
        "cluster": CLUSTER,
        "teleoperation": TELEOPERATION,
        "simulation": SIMULATION,
    },
    entry_points={"console_scripts": SCRIPTS},
    cmdclass={"install_data": InstallData},
)
