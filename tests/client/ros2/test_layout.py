"""Keys, tokens and attachments, byte for byte as rmw_zenoh's documents and source have them.

Keys and tokens are the examples of design.md (branch jazzy). Identities are what `simplified_xxhash3.cpp` of that
repository, compiled, made of the tokens. Type hashes are those that other implementations list for these types.
"""

import pytest
from abs_client.ros2 import cdr, layout
from abs_client.ros2.layout import Node, Qos
from zenoh.ext import Int64, z_serialize

STRING = "RIHS01_df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18"
TALKER = Node(2, "8b20917502ee955ac4476e0266340d5c", "talker")
TOKEN = (
    "@ros2_lv/2/8b20917502ee955ac4476e0266340d5c/0/10/MP/%/%/talker/%chatter/std_msgs::msg::dds_::String_/"
    f"{STRING}/::,7:,:,:,,"
)
LONG = (
    "@ros2_lv/0/8b20917502ee955ac4476e0266340d5c/0/3/MP/%/%/abs_service_a_rig_with_a_rather_long_name/"
    "%a_rig_with_a_rather_long_name%structured_light%depth%camera_info/sensor_msgs::msg::dds_::CameraInfo_/"
    "RIHS01_b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275/:1:,1:,:,:,,"
)
HASHES = {
    "diagnostic_msgs/msg/DiagnosticArray": "5a8a36efb05fb25070fa0fb3810290c0e6cd4862b54a8fb975a1ee8dc55a333e",
    "sensor_msgs/msg/CameraInfo": "b3dfd68ff46c9d56c80fd3bd4ed22c7a4ddce8c8348f2f59c299e73118e7e275",
    "sensor_msgs/msg/Image": "d31d41a9a4c4bc8eae9be757b0beed306564f7526c88ea6a4588fb9582527d47",
    "sensor_msgs/msg/PointCloud2": "9198cabf7da3796ae6fe19c4cb3bdd3525492988c70522628af5daa124bae2b5",
    "std_msgs/msg/Float64MultiArray": "1025ddc6b9552d191f89ef1a8d2f60f3d373e28b283d8891ddcc974e8c55397f",
    "tf2_msgs/msg/TFMessage": "e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087",
    "visualization_msgs/msg/Marker": "45b13ccf791f225962bf74e746f9644518855d783a6f42ba0cc14fde2b4f3ce0",
}


def test_the_key_of_a_topic():
    node = Node(0, "any", "talker")
    assert node.key("/chatter", "std_msgs/msg/String", STRING) == f"0/chatter/std_msgs::msg::dds_::String_/{STRING}"
    in_a_namespace = node.key("/robot1/chatter", "std_msgs/msg/String", STRING)
    assert in_a_namespace == f"0/robot1/chatter/std_msgs::msg::dds_::String_/{STRING}"


def test_the_token_of_a_node():
    node = Node(2, "aac3178e146ba6f1fc6e6a4085e77f21", "listener")
    assert node.token() == "@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener"


def test_the_token_of_a_publisher():
    assert TALKER.publisher_token(10, "/chatter", "std_msgs/msg/String", STRING, Qos(depth=7)) == TOKEN


def test_the_quality_of_service_of_what_late_subscriptions_get():
    assert Qos(depth=1, transient_local=True).text() == ":1:,1:,:,:,,"


@pytest.mark.parametrize(
    ("token", "identity"),
    [
        ("@ros2_lv/2/aac3178e146ba6f1fc6e6a4085e77f21/0/0/NN/%/%/listener", "49877999dacb858702d11ac823785912"),
        (TOKEN, "ac170f31eadcd9ff0cd86d7a17907d1c"),
        (LONG, "71d2bb389f4844b09c9b4ff37491294a"),
    ],
    ids=["short", "medium", "long"],
)
def test_the_identity_of_a_publisher_is_the_hash_of_its_token(token, identity):
    assert layout.gid(token).hex() == identity


def test_an_attachment():
    sent = layout.attachment(7, 1_700_000_000_123_456_789, bytes(range(16)))
    assert sent.hex() == "0700000000000000" + "15cd853dfe9c9717" + "10" + "000102030405060708090a0b0c0d0e0f"


def test_an_attachment_is_what_zenohs_own_serializer_makes_of_it():
    sent = layout.attachment(7, 8, bytes(range(16)))
    serialized = z_serialize((Int64(7), Int64(8), bytes(range(16))))
    assert sent == serialized.to_bytes()


@pytest.mark.parametrize("name", HASHES)
def test_the_hash_of_a_type(name):
    assert cdr.type_hash(name) == f"RIHS01_{HASHES[name]}"


@pytest.mark.parametrize(
    ("name", "allowed"), [("demo", "demo"), ("structured-light", "structured_light"), ("4d", "n4d")]
)
def test_a_name_as_ros_allows_it(name, allowed):
    assert layout.ros_name(name) == allowed
