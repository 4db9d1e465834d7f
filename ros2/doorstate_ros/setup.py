# SPDX-License-Identifier: Apache-2.0
"""Installation of this package by colcon."""

from pathlib import Path

from setuptools import setup

NAME = "doorstate_ros"

setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        (f"share/{NAME}/launch", sorted(map(str, Path("launch").glob("*.launch.py")))),
        (f"share/{NAME}/config", sorted(map(str, Path("config").iterdir()))),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The doorstate developers",
    maintainer_email="doorstate@users.noreply.github.com",
    description="The state of a door (open, semi-open, closed) from the clouds of a depth camera.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["doorstate_node = doorstate_ros.node:main"]},
)
