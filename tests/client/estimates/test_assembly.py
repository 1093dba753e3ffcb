"""An estimate is given when all of its messages are there, in whatever order, and only if it is the newest."""

from itertools import permutations

import numpy as np
import pytest
from abs_client.estimates.assembly import KEPT, Assembly

from tests.client.messages import TRIANGLE, mesh, state, topology

FOUR = np.vstack([TRIANGLE, TRIANGLE[:1] + TRIANGLE[1:2]])


@pytest.fixture
def assembly():
    return Assembly(lambda: 7)


@pytest.mark.parametrize("order", list(permutations(["state", "mesh", "topology"])))
def test_the_order_in_which_messages_arrive_does_not_matter(assembly, order):
    for kind in order:
        assert assembly.take() is None
        message = topology() if kind == "topology" else {"state": state, "mesh": mesh}[kind](4)
        getattr(assembly, f"add_{kind}")(message)
    whole = assembly.take()
    assert (whole.state.header.seq, whole.mesh.header.seq, whole.topology.mesh_version) == (4, 4, 1)
    assert whole.arrived_ns == 7
    assert assembly.take() is None


def test_only_the_newest_is_given(assembly):
    assembly.add_topology(topology())
    for seq in (1, 2, 3):
        assembly.add_state(state(seq))
        assembly.add_mesh(mesh(seq))
    assert assembly.take().state.header.seq == 3
    assembly.add_state(state(2))
    assembly.add_mesh(mesh(2))
    assert assembly.take() is None


def test_vertices_wait_for_the_topology_of_their_version(assembly):
    assembly.add_topology(topology(1))
    assembly.add_state(state(5, version=2))
    assembly.add_mesh(mesh(5, version=2, vertices=FOUR))
    assert assembly.take() is None
    assert assembly.lacks_topology
    assembly.add_topology(topology(2, vertices=FOUR))
    assert assembly.take().topology.mesh_version == 2
    assert not assembly.lacks_topology


def test_a_restarted_tracker_counts_anew_and_its_first_mesh_is_not_that_of_the_one_before(assembly):
    assembly.add_topology(topology(1, "a"))
    assembly.add_state(state(900, boot="a"))
    assembly.add_mesh(mesh(900, boot="a"))
    assert assembly.take().state.header.seq == 900
    assembly.add_state(state(0, boot="b"))
    assembly.add_mesh(mesh(0, boot="b", vertices=FOUR))
    assert assembly.take() is None
    assembly.add_topology(topology(1, "b", FOUR))
    assert (whole := assembly.take()).topology.header.boot_id == "b"
    assert len(whole.mesh.vertices_f32) == FOUR.nbytes


def test_an_estimate_without_an_object_needs_no_topology(assembly):
    assembly.add_state(state(1, version=0))
    assembly.add_mesh(mesh(1, version=0, vertices=np.zeros((0, 3))))
    assert assembly.take().topology.faces_u32 == b""


def test_vertices_and_topology_of_different_numbers_are_never_joined(assembly):
    assembly.add_topology(topology(1))
    assembly.add_state(state(1))
    assembly.add_mesh(mesh(1, vertices=FOUR))
    assert assembly.take() is None


def test_what_stays_incomplete_is_not_kept_for_ever(assembly):
    for seq in range(10 * KEPT):
        assembly.add_state(state(seq))
        assembly.add_mesh(mesh(1000 + seq))
    assembly.add_topology(topology())
    assembly.add_mesh(mesh(3))
    assert assembly.take() is None
