"""Installs the node as ament wants it."""

from setuptools import setup

PACKAGE = "sketchmatch_ros"

setup(
    name=PACKAGE,
    version="0.1.0",
    packages=[PACKAGE],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
        (f"share/{PACKAGE}/launch", ["launch/sketchmatch.launch.py"]),
        (f"share/{PACKAGE}/config", ["config/sketchmatch.yaml"]),
        (f"share/{PACKAGE}/rviz", ["rviz/sketchmatch.rviz"]),
    ],
    install_requires=["setuptools", "sketchmatch-client"],
    extras_require={"test": ["pytest"]},  # where colcon test finds this it runs pytest
    description="A lifecycle node that matches sketches with the robot's map.",
    license="Apache-2.0",
    entry_points={"console_scripts": [f"sketchmatch = {PACKAGE}.node:main"]},
)
