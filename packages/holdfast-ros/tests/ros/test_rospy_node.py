import sys
from http.server import BaseHTTPRequestHandler, HTTPServer
from socket import create_server
from threading import Thread
from xmlrpc.server import SimpleXMLRPCRequestHandler, SimpleXMLRPCServer

import pytest

from holdfast.errors import SourceError
from holdfast_ros import rospy_node
from holdfast_ros.rospy_node import (
    check_master,
    master_uri,
    published_topics,
    publishers_of,
    rospy_module,
    start_node,
    subscribed_topics,
)


class _Silent(SimpleXMLRPCRequestHandler):
    protocol_version = "HTTP/1.0"

    def log_message(self, *_):
        pass


@pytest.fixture
def master():
    """A server that answers like a ROS master, from a dictionary."""
    answers = {}
    with SimpleXMLRPCServer(("127.0.0.1", 0), _Silent) as server:
        for name in ("getPid", "getSystemState", "getTopicTypes", "lookupNode"):
            server.register_function(lambda *_, name=name: answers[name], name)
        thread = Thread(target=server.serve_forever, kwargs={"poll_interval": 0.01})
        thread.start()
        yield f"http://127.0.0.1:{server.server_address[1]}", answers
        server.shutdown()
        thread.join()


def test_published_topics(master):
    uri, answers = master
    answers["getPid"] = (1, "", 7)
    check_master(uri)
    answers["getSystemState"] = (1, "", [[["/a", ["node"]], ["/b", []]], [["/c", ["n"]]], []])
    answers["getTopicTypes"] = (1, "", [["/a", "p/A"], ["/b", "p/B"], ["/c", "p/C"]])
    assert published_topics(uri) == {"/a": "p/A"}


def test_publishers_that_do_not_answer_are_not_listed(master):
    uri, answers = master
    answers["getPid"] = (1, "", 7)
    answers["lookupNode"] = (1, "", uri)  # its own node here: it answers
    answers["getSystemState"] = (1, "", [[["/a", ["/node"]]], [["/c", ["/n"]], ["/d", []]], []])
    assert publishers_of(uri, "/a") == ["/node"]
    assert publishers_of(uri, "/b") == []
    assert subscribed_topics(uri) == ["/c"]
    with create_server(("127.0.0.1", 0)) as free:
        dead = f"http://127.0.0.1:{free.getsockname()[1]}"
    answers["lookupNode"] = (1, "", dead)
    assert publishers_of(uri, "/a") == []
    answers["lookupNode"] = (-1, "unknown node", "")
    assert publishers_of(uri, "/a") == []


def test_a_master_that_refuses(master):
    uri, answers = master
    answers["getPid"] = (-1, "not now", 0)
    with pytest.raises(SourceError, match=f"^the ROS master at {uri} refuses getPid: not now$"):
        check_master(uri)


def test_a_server_that_is_not_a_master(master):
    uri, answers = master
    answers["getPid"] = 7
    with pytest.raises(SourceError, match="is not a ROS master"):
        check_master(uri)
    del answers["getPid"]
    with pytest.raises(SourceError, match="is not a ROS master"):
        check_master(uri)


def test_no_server():
    with create_server(("127.0.0.1", 0)) as free:
        uri = f"http://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(SourceError) as caught:
        start_node(uri)
    assert str(caught.value) == (
        f"no ROS master answers at {uri} (Connection refused): is roscore running? "
        "ROS_MASTER_URI or ?master= sets its address"
    )


def test_a_server_that_does_not_answer(monkeypatch):
    monkeypatch.setattr(rospy_node, "MASTER_TIMEOUT", 0.1)
    with create_server(("127.0.0.1", 0)) as mute:
        uri = f"http://127.0.0.1:{mute.getsockname()[1]}"
        with pytest.raises(SourceError, match=r"no ROS master answers at .* \(timed out\)"):
            check_master(uri)


def test_another_web_server():
    class Handler(BaseHTTPRequestHandler):
        def do_POST(self):
            self.send_error(404)

        def log_message(self, *_):
            pass

    with HTTPServer(("127.0.0.1", 0), Handler) as server:
        thread = Thread(target=server.handle_request)
        thread.start()
        with pytest.raises(SourceError, match=r"is not a ROS master: .*404"):
            check_master(f"http://127.0.0.1:{server.server_address[1]}")
        thread.join()


def test_the_uri_of_the_master(monkeypatch):
    monkeypatch.delenv("ROS_MASTER_URI", raising=False)
    assert master_uri(None) == "http://localhost:11311"
    monkeypatch.setenv("ROS_MASTER_URI", "http://robot:11311/")
    assert master_uri(None) == "http://robot:11311"
    assert master_uri("http://10.0.0.1:1") == "http://10.0.0.1:1"
    for bad in ("robot:11311", "http://robot", "https://robot:1", "http://robot:port"):
        with pytest.raises(ValueError, match="a ROS master like http://localhost:11311 expected, "):
            master_uri(bad)


def test_no_rospy_at_all(monkeypatch):
    path = list(sys.path)
    monkeypatch.setitem(sys.modules, "rospy", None)
    monkeypatch.setattr(rospy_node, "ROSPY_FOLDERS", ())
    with pytest.raises(SourceError) as caught:
        rospy_module()
    assert str(caught.value) == (
        "this needs rospy of ROS 1, which pip cannot install: apt install python3-rospy, and "
        f"a Python of the same version (this is 3.{sys.version_info[1]})"
    )
    assert sys.path == path


def test_a_rospy_for_another_python_is_not_imported(tmp_path, monkeypatch):
    (tmp_path / "rospy").mkdir()
    monkeypatch.setitem(sys.modules, "rospy", None)
    monkeypatch.setattr(rospy_node, "ROSPY_FOLDERS", (str(tmp_path),))
    monkeypatch.setattr(rospy_node, "system_pythons", lambda: ["python3.5", "python3.5-config"])
    path = list(sys.path)
    with pytest.raises(SourceError, match="apt install python3-rospy"):
        rospy_module()
    assert sys.path == path
