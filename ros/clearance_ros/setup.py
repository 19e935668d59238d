from setuptools import setup

setup(
    name="clearance_ros",
    version="0.1.0",
    packages=["clearance_ros"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/clearance_ros"]),
        ("share/clearance_ros", ["package.xml"]),
        ("share/clearance_ros/launch", ["launch/clearance.launch.py"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    license="Apache-2.0",
    description="Joint states and planning scenes to a running clearanced, certified distances back.",
    entry_points={"console_scripts": ["bridge = clearance_ros.node:main"]},
)
