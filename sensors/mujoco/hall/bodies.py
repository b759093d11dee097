"""Boxes, a person and the robot as MJCF bodies, and the model of all of them in a building. Lengths in m, masses in kg."""

from .building import INTANGIBLE, ROBOT, SHADE, SOLID, Building
from .robot import HEIGHT_M, RADIUS_M, TRACK_M, WHEEL_RADIUS_M
from .scenario import Box

BOX_SIZE_M = (0.24, 0.24, 0.35)
#: Time step of the physics.
PHYSICS_STEP_S = 0.004
PERSON = ("torso", "leg_l", "leg_r")


def model(building: Building, boxes: tuple[Box, ...]) -> str:
    """Returns the model of a building with boxes, a person (below the floor until placed) and the robot."""
    placed = "".join(_box(number, *box) for number, box in enumerate(boxes))
    drive = "".join(f'<velocity name="{w}" joint="{w}" kv="8" forcerange="-4 4"/>' for w in ("left", "right"))
    return f"""<mujoco model="hallway">
  <compiler angle="degree"/>
  <option timestep="{PHYSICS_STEP_S}" integrator="implicitfast"/>
  <visual><global offwidth="1024" offheight="1024"/><quality shadowsize="1024" offsamples="0" numquads="3"/>
    <headlight ambient="0.42 0.42 0.43" diffuse="0 0 0" specular="0 0 0"/><map znear="0.004" zfar="6" shadowclip="1.2"/></visual>
  <statistic center="6 0 1" extent="5"/>
  <asset>{"".join(building.asset_xml)}</asset>
  <worldbody>{"".join(building.body_xml)}{placed}{_person()}{_robot()}
    <camera name="eye" mode="fixed" pos="0 0 1"/></worldbody>
  <actuator>{drive}</actuator>
</mujoco>"""

def _box(number: int, x: float, y: float, color: str) -> str:
    half_x, half_y, half_z = (size / 2 for size in BOX_SIZE_M)
    # Soft shadow where the box touches the floor.
    shadow = "".join(
        f'<geom type="box" pos="0 0 {0.0012 - 0.0003 * k - half_z}" '
        f'size="{half_x + 0.006 + 0.008 * k} {half_y + 0.006 + 0.008 * k} .0001" rgba="0 0 0 .11" '
        f'group="{SHADE}" {INTANGIBLE} mass="0"/>'
        for k in range(4)
    )
    return (
        f'<body name="box{number}" pos="{x} {y} {half_z}"><freejoint/>'
        f'<geom type="box" size="{half_x} {half_y} {half_z}" mass="2.5" material="box_{color}" group="{SOLID}" '
        f'friction="0.6 0.005 0.0001"/>{shadow}</body>'
    )


def _person() -> str:
    torso = (
        '<body name="torso" mocap="true" pos="0 0 -5">'
        f'<geom type="capsule" fromto="0 0 .85 0 0 1.40" size="0.19" rgba=".22 .30 .46 1" group="{SOLID}"/>'
        f'<geom type="sphere" pos="0 0 1.68" size="0.11" rgba=".80 .62 .50 1" group="{SOLID}"/></body>'
    )
    legs = (
        f'<body name="{leg}" mocap="true" pos="0 0 -5">'
        f'<geom type="capsule" fromto="0 0 .08 0 0 .82" size="0.075" rgba=".14 .14 .17 1" group="{SOLID}"/>'
        f'<geom type="box" pos=".06 0 .04" size=".13 .05 .04" rgba=".06 .05 .05 1" group="{SOLID}"/></body>'
        for leg in PERSON[1:]
    )
    return torso + "".join(legs)


def _robot() -> str:
    half_height = (HEIGHT_M - 0.05) / 2
    hull = (
        f'<geom name="hull" type="cylinder" pos="0 0 {0.05 + half_height}" size="{RADIUS_M} {half_height}" '
        f'mass="1" rgba=".55 .12 .10 1" group="{ROBOT}" contype="2" conaffinity="1"/>'
    )
    # Low and behind the axle, so that the robot rests on both wheels and the rear caster.
    battery = (
        '<geom type="box" pos="-0.035 0 0.08" size="0.08 0.06 0.03" mass="8" rgba=".1 .1 .1 1" '
        f'group="{ROBOT}" {INTANGIBLE}/>'
    )
    parts = (_wheel("left", TRACK_M / 2), _wheel("right", -TRACK_M / 2), _caster(-0.15, 0.03), _caster(0.15, 0.034))
    return f'<body name="robot"><freejoint name="robot"/>{hull}{battery}{"".join(parts)}</body>'


def _wheel(name: str, y: float) -> str:
    return (
        f'<body name="{name}" pos="0 {y} {WHEEL_RADIUS_M}"><joint name="{name}" type="hinge" axis="0 1 0" damping="0.01"/>'
        f'<geom name="{name}" type="cylinder" size="{WHEEL_RADIUS_M} 0.02" euler="90 0 0" mass="0.6" rgba=".08 .08 .08 1" '
        f'group="{ROBOT}" friction="0.9 0.01 0.0001" contype="2" conaffinity="1"/></body>'
    )


def _caster(x: float, z: float) -> str:
    return (
        f'<geom type="sphere" pos="{x} 0 {z}" size="0.03" mass="0.2" group="{ROBOT}" friction="0.01 0.0001 0.0001" '
        'rgba=".4 .4 .4 1" priority="2" contype="2" conaffinity="1"/>'
    )
