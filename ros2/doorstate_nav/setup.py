# SPDX-License-Identifier: Apache-2.0
"""Installation of this package by colcon."""

from pathlib import Path

from setuptools import setup

NAME = "doorstate_nav"

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
    description="Waiting for doors, edges of a route graph through doors, and doors of Open-RMF.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "wait_server = doorstate_nav.wait_server:main",
            "edge_client = doorstate_nav.edge_client:main",
            "rmf_adapter = doorstate_nav.rmf_adapter:main",
        ]
    },
)
