"""Starting the studio: mistakes are told before anything is begun."""

import asyncio
import socket
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest
import uvicorn
from filelock import FileLock
from uvicorn.server import ServerState

from orbiflow.errors import OrbiflowError, SettingError
from orbiflow.studio import Store, StudioSettings
from orbiflow.studio.app import PatientProtocol, Server
from orbiflow.studio.hub import Hub
from orbiflow.studio.operations import studio
from refusals import refused


def test_what_is_missing_is_named(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "uvicorn", None)
    with pytest.raises(OrbiflowError, match=r"needs uvicorn.*pip install 'orbiflow\[studio\]'"):
        studio(StudioSettings(data=tmp_path / "data", browser=False))
    assert not (tmp_path / "data").exists()


def test_a_port_that_is_taken_is_told(tmp_path: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        settings = StudioSettings(data=tmp_path, browser=False, port=port)
        with pytest.raises(SettingError, match=f"port {port} cannot be used") as caught:
            studio(settings)
    assert "--port" in caught.value.named(lambda name: f"--{name}")


@pytest.mark.parametrize("host", ["no.such.name.invalid", "192.0.2.1", "{}", "a" * 99])
def test_a_host_that_is_not_this_machine_is_named(host: str, tmp_path: Path) -> None:
    settings = StudioSettings(data=tmp_path, browser=False, host=host)
    with pytest.raises(SettingError) as caught:
        studio(settings)
    told = caught.value.named(lambda name: f"--{name}")
    assert told.startswith(f"--host {host} is no address of this machine (")
    assert told.endswith("; leave --host out")


@pytest.mark.parametrize("name", ["file", "file/below", "/proc/foo", "/sys/foo"])
def test_a_folder_that_cannot_be_had_is_told(name: str, tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OrbiflowError, match=r"cannot write into .*; give another folder as data"):
        studio(StudioSettings(data=tmp_path / name, browser=False))


def test_two_studios_do_not_share_a_folder(tmp_path: Path) -> None:
    own = StudioSettings(data=tmp_path, browser=False)
    with FileLock(tmp_path / "studio.lock"), refused("another studio", kind=OrbiflowError):
        studio(own)
    # only this machine comes without a token
    assert StudioSettings().is_local
    assert StudioSettings(host="::1").is_local
    assert not StudioSettings(host="0.0.0.0").is_local


def test_a_connection_that_says_nothing_is_closed() -> None:
    waits, closed = list[Any](), list[bool]()
    loop = SimpleNamespace(call_later=lambda seconds, call: waits.append((seconds, call)))
    silent = {"get_extra_info": lambda *_: None, "write": lambda _: None}
    transport = SimpleNamespace(close=lambda: closed.append(True), **silent)
    config = uvicorn.Config(_app, interface="asgi3", log_config=None, ws="none")
    config.load()
    own = PatientProtocol(config, ServerState(), {}, loop)  # pyright: ignore[reportArgumentType]
    own.connection_made(transport)  # pyright: ignore[reportArgumentType]
    ((seconds, hang_up),) = waits
    assert 0 < seconds < 60
    own.cycle = SimpleNamespace()  # pyright: ignore[reportAttributeAccessIssue]
    hang_up()
    assert not closed
    own.cycle = None  # pyright: ignore[reportAttributeAccessIssue]
    hang_up()
    assert closed


def test_streams_end_when_the_server_stops(tmp_path: Path) -> None:
    async def watch() -> list[str]:
        store = Store(tmp_path)
        hub, log = Hub(store), list[str]()
        hub.open(asyncio.get_running_loop())
        stream = hub.stream(store.create("tile", "a project", 9), 0)

        async def read() -> None:
            async for _ in stream:
                log.append("news")
            log.append("end")

        reader = asyncio.create_task(read())
        await asyncio.sleep(0)
        config = uvicorn.Config(_app, log_config=None)
        server = Server(config, hub)
        server.servers, server.lifespan = [], SimpleNamespace(shutdown=_nothing)  # pyright: ignore
        await server.shutdown()
        await reader
        store.close()
        return log

    assert asyncio.run(watch())[-1] == "end"


async def _app(_scope: Any, _receive: Any, _send: Any) -> None:
    pass


async def _nothing(*_: object) -> None:
    pass


def test_the_server_imports_no_numerical_library() -> None:
    code = """
import sys
import orbiflow.studio.app
from orbiflow.runtime import find
from orbiflow.studio.kinds_of_work import KINDS
for kind in KINDS.values():
    find(kind.work), find(kind.makes or kind.work)
print(sorted({"numpy", "scipy", "shapely", "torch", "PIL", "matplotlib"} & set(sys.modules)))
"""
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert told.stdout.strip() == "[]"
