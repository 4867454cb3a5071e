"""Definitions of the ROS 2 messages in a log, as the ``ros2msg`` schemas of MCAP want them.

Interface definitions of ROS 2 (common_interfaces and rcl_interfaces, Apache License 2.0), without comments; a test
holds the assembled schemas against those that the ``rosbags`` package generates.
"""

from __future__ import annotations

_SEPARATOR = "=" * 80 + "\n"

_DEFINITIONS = {
    "builtin_interfaces/Duration": """\
int32 sec
uint32 nanosec
""",
    "builtin_interfaces/Time": """\
int32 sec
uint32 nanosec
""",
    "geometry_msgs/Point": """\
float64 x
float64 y
float64 z
""",
    "geometry_msgs/PointStamped": """\
std_msgs/Header header
geometry_msgs/Point point
""",
    "geometry_msgs/Pose": """\
geometry_msgs/Point position
geometry_msgs/Quaternion orientation
""",
    "geometry_msgs/PoseArray": """\
std_msgs/Header header
geometry_msgs/Pose[] poses
""",
    "geometry_msgs/PoseStamped": """\
std_msgs/Header header
geometry_msgs/Pose pose
""",
    "geometry_msgs/Quaternion": """\
float64 x
float64 y
float64 z
float64 w
""",
    "geometry_msgs/Transform": """\
geometry_msgs/Vector3 translation
geometry_msgs/Quaternion rotation
""",
    "geometry_msgs/TransformStamped": """\
std_msgs/Header header
string child_frame_id
geometry_msgs/Transform transform
""",
    "geometry_msgs/Vector3": """\
float64 x
float64 y
float64 z
""",
    "geometry_msgs/Wrench": """\
geometry_msgs/Vector3 force
geometry_msgs/Vector3 torque
""",
    "geometry_msgs/WrenchStamped": """\
std_msgs/Header header
geometry_msgs/Wrench wrench
""",
    "rcl_interfaces/Log": """\
byte DEBUG=10
byte INFO=20
byte WARN=30
byte ERROR=40
byte FATAL=50
builtin_interfaces/Time stamp
uint8 level
string name
string msg
string file
string function
uint32 line
""",
    "rosgraph_msgs/Clock": """\
builtin_interfaces/Time clock
""",
    "sensor_msgs/CompressedImage": """\
std_msgs/Header header
string format
uint8[] data
""",
    "sensor_msgs/PointCloud2": """\
std_msgs/Header header
uint32 height
uint32 width
sensor_msgs/PointField[] fields
bool is_bigendian
uint32 point_step
uint32 row_step
uint8[] data
bool is_dense
""",
    "sensor_msgs/PointField": """\
uint8 INT8=1
uint8 UINT8=2
uint8 INT16=3
uint8 UINT16=4
uint8 INT32=5
uint8 UINT32=6
uint8 FLOAT32=7
uint8 FLOAT64=8
string name
uint32 offset
uint8 datatype
uint32 count
""",
    "std_msgs/ColorRGBA": """\
float32 r
float32 g
float32 b
float32 a
""",
    "std_msgs/Float64": """\
float64 data
""",
    "std_msgs/Float64MultiArray": """\
std_msgs/MultiArrayLayout layout
float64[] data
""",
    "std_msgs/Header": """\
builtin_interfaces/Time stamp
string frame_id
""",
    "std_msgs/MultiArrayDimension": """\
string label
uint32 size
uint32 stride
""",
    "std_msgs/MultiArrayLayout": """\
std_msgs/MultiArrayDimension[] dim
uint32 data_offset
""",
    "tf2_msgs/TFMessage": """\
geometry_msgs/TransformStamped[] transforms
""",
    "visualization_msgs/Marker": """\
int32 ARROW=0
int32 CUBE=1
int32 SPHERE=2
int32 CYLINDER=3
int32 LINE_STRIP=4
int32 LINE_LIST=5
int32 CUBE_LIST=6
int32 SPHERE_LIST=7
int32 POINTS=8
int32 TEXT_VIEW_FACING=9
int32 MESH_RESOURCE=10
int32 TRIANGLE_LIST=11
int32 ARROW_STRIP=12
int32 ADD=0
int32 MODIFY=0
int32 DELETE=2
int32 DELETEALL=3
std_msgs/Header header
string ns
int32 id
int32 type
int32 action
geometry_msgs/Pose pose
geometry_msgs/Vector3 scale
std_msgs/ColorRGBA color
builtin_interfaces/Duration lifetime
bool frame_locked
geometry_msgs/Point[] points
std_msgs/ColorRGBA[] colors
string texture_resource
sensor_msgs/CompressedImage texture
visualization_msgs/UVCoordinate[] uv_coordinates
string text
string mesh_resource
visualization_msgs/MeshFile mesh_file
bool mesh_use_embedded_materials
""",
    "visualization_msgs/MarkerArray": """\
visualization_msgs/Marker[] markers
""",
    "visualization_msgs/MeshFile": """\
string filename
uint8[] data
""",
    "visualization_msgs/UVCoordinate": """\
float32 u
float32 v
""",
}


def _dependencies(name: str) -> list[str]:
    """Return the types that `name` needs, itself first, each once, in the order in which they are met."""
    found: list[str] = []
    for field_type in (line.split()[0].removesuffix("[]") for line in _DEFINITIONS[name].splitlines()):
        if field_type in _DEFINITIONS:
            found += _dependencies(field_type)
    return list(dict.fromkeys([name, *found]))


def schema_text(ros_type: str) -> str:
    """Return the definition of ``package/msg/Type`` followed by those of all types that it needs."""
    first, *others = _dependencies(ros_type.replace("/msg/", "/"))
    return _DEFINITIONS[first] + "".join(f"{_SEPARATOR}MSG: {name}\n{_DEFINITIONS[name]}" for name in others)
