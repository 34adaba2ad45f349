"""The server: what it answers, to whom, and what it listens at."""

import http.client
import socket
import threading

import pytest
from helpers import must_fail

from sommerl.system.errors import OptionError
from sommerl.viewer.server import Server

PAGE = "<!doctype html><title>π</title>".encode()
POLICY = "default-src 'none'"
TRICKS = [
    "//", "/.", "/..", "/../", "/%2e%2e/", "/index.html", "/?", "/?x=1", "/#x", "/page.html", "/etc/passwd",
    "//etc/passwd", "/../../etc/passwd", "/..%2f..%2fetc%2fpasswd", "/\\..\\", "*", "http://127.0.0.1/", "http://evil.example/",
    "file:///etc/passwd", "/favicon.ico", "/a/b", "/%00", "/%",
]  # fmt: skip
METHODS = ["POST", "PUT", "DELETE", "PATCH", "OPTIONS", "TRACE", "CONNECT", "PROPFIND", "get"]
FOREIGN = [
    "evil.example", "evil.example:{port}", "127.0.0.1", "127.0.0.1:1", "localhost", "localhost:{port}.evil.example",
    "127.0.0.1:{port}@evil.example", "[::1]:{port}", "0.0.0.0:{port}", "127.1:{port}", "",
    "127.0.0.1:{port}, evil.example",
]  # fmt: skip


@pytest.fixture
def server():
    with Server(PAGE, POLICY) as made:
        thread = threading.Thread(target=made.serve_forever, args=(0.01,))
        thread.start()
        yield made
        made.shutdown()
        thread.join()


def asked(server, method="GET", path="/", hosts=("127.0.0.1:{port}",)):
    """Status, headers and body of an answer."""
    connection = http.client.HTTPConnection("127.0.0.1", server.server_port, timeout=10)
    try:
        connection.putrequest(method, path, skip_host=True, skip_accept_encoding=True)
        for host in hosts:
            connection.putheader("Host", host.format(port=server.server_port))
        connection.endheaders()
        answer = connection.getresponse()
        return answer.status, answer.headers, answer.read()
    finally:
        connection.close()


def check_answers(server, status, **request):
    found, headers, body = asked(server, **request)
    assert found == status
    assert (body == PAGE) == (status == 200)
    assert headers["X-Content-Type-Options"] == "nosniff"
    assert headers["Content-Security-Policy"] == "default-src 'none'; frame-ancestors 'none'"


@pytest.mark.parametrize("host", ["127.0.0.1:{port}", "localhost:{port}", "LocalHost:{port}"])
def test_the_page_is_served_to_who_names_this_server(server, host):
    check_answers(server, 200, hosts=[host])
    status, headers, body = asked(server, "HEAD", hosts=[host])
    assert (status, body) == (200, b"")
    assert headers["Content-Length"] == str(len(PAGE))
    assert headers["Content-Type"] == "text/html; charset=utf-8"
    assert headers["Server"] == "Sommerl"
    must_fail(check_answers, server, 403)


@pytest.mark.parametrize("host", FOREIGN)
def test_another_host_is_refused(server, host):
    check_answers(server, 403, hosts=[host])


def test_no_host_and_two_hosts_are_refused(server):
    check_answers(server, 403, hosts=[])
    check_answers(server, 403, hosts=["127.0.0.1:{port}"] * 2)
    check_answers(server, 403, hosts=["127.0.0.1:{port}", "evil.example"])


@pytest.mark.parametrize("path", TRICKS)
def test_any_other_path_is_not_there(server, path):
    check_answers(server, 404, path=path)
    check_answers(server, 403, path=path, hosts=["evil.example"])


@pytest.mark.parametrize("method", METHODS)
def test_other_methods_are_refused(server, method):
    check_answers(server, 405, method=method)
    assert asked(server, method)[1]["Allow"] == "GET, HEAD"


@pytest.mark.parametrize(
    "data", [b"\r\n\r\n", b"x\r\n\r\n", b"GET / HTTP/9.9\r\n\r\n", b"\xff\x00\r\n\r\n", b"GET " + b"/" * 70000]
)
def test_what_is_no_request_gets_no_page(server, data):
    with socket.create_connection(("127.0.0.1", server.server_port), timeout=10) as connection:
        connection.sendall(data)
        connection.shutdown(socket.SHUT_WR)
        found = b""
        try:
            while part := connection.recv(4096):
                found += part
        except ConnectionResetError:
            pass
    assert PAGE not in found
    check_answers(server, 200)


def test_a_silent_connection_keeps_no_one_else_waiting(server):
    with socket.create_connection(("127.0.0.1", server.server_port)):
        check_answers(server, 200)


def check_address(server):
    assert server.socket.getsockname()[0] == "127.0.0.1"
    assert server.url == f"http://127.0.0.1:{server.server_port}/"


def test_it_listens_to_this_machine_alone(server, monkeypatch):
    check_address(server)
    monkeypatch.setattr("sommerl.viewer.server.ADDRESS", "0.0.0.0")
    with Server(PAGE, POLICY) as everywhere:
        must_fail(check_address, everywhere)


def test_a_port_that_is_taken(server):
    with pytest.raises(OptionError, match=f"port: expected a free port, found {server.server_port} \\(.*in use"):
        Server(PAGE, POLICY, server.server_port)
