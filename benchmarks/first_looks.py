"""How long somebody waits for the first certified tile: in a terminal, and in the studio.

    python benchmarks/first_looks.py [--effort fast|normal] [FILE]

In the studio from the moment a search is asked for, alone and while another project searches.
"""

from __future__ import annotations

import argparse
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import httpx
from common import BUNDLED

PATIENCE = 300.0  # seconds


def until(holds: Callable[[], Any]) -> float:
    """Wait until a function returns something true; return for how many seconds."""
    begin = time.perf_counter()
    while not holds():
        if time.perf_counter() - begin > PATIENCE:
            raise SystemExit(f"{holds} never became true")
        time.sleep(0.02)
    return time.perf_counter() - begin


def in_terminal(picture: Path, effort: str, out: Path) -> float:
    """Seconds from Enter to the line that names the first tile."""
    begin = time.perf_counter()
    command = [sys.executable, "-m", "orbiflow", "escherize", str(picture), "--effort", effort]
    with subprocess.Popen(
        [*command, "--out", str(out)], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    ) as process:
        assert process.stdout is not None
        for line in process.stdout:
            if "first tile" in line:
                break
        seconds = time.perf_counter() - begin
        process.send_signal(signal.SIGKILL)
    return seconds


def in_studio(picture: Path, effort: str, folder: Path) -> tuple[float, float]:
    """Seconds from asking to the first tile: alone, and while another project searches."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port = free.getsockname()[1]
    own = ["studio", "--port", str(port), "--data", str(folder), "--no-browser"]
    server = subprocess.Popen([sys.executable, "-m", "orbiflow", *own], stdout=subprocess.DEVNULL)
    client = httpx.Client(
        base_url=f"http://127.0.0.1:{port}/api/", headers={"X-Orbiflow": "1"}, trust_env=False
    )

    def answers() -> bool:
        try:
            return client.get("about").is_success
        except httpx.TransportError:
            return False

    def project() -> str:
        name = client.post("projects", json={"kind": "tile"}).json()["id"]
        client.put(
            f"projects/{name}/input", params={"name": picture.name}, content=picture.read_bytes()
        )
        until(lambda: client.get(f"projects/{name}").json()["silhouette"])
        return name

    def search(name: str) -> float:
        body = {"operation": "search", "settings": {"effort": effort}}
        client.post(f"projects/{name}/tasks", json=body).raise_for_status()
        return until(lambda: client.get(f"projects/{name}").json()["tiles"])

    try:
        until(answers)
        one, other = project(), project()
        time.sleep(10)  # somebody looks at the picture; workers get ready
        alone = search(one)
        time.sleep(2)
        return alone, search(other)
    finally:
        server.send_signal(signal.SIGINT)
        server.wait()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("picture", nargs="?", type=Path, default=BUNDLED / "squirrel.dat")
    parser.add_argument("--effort", choices=("fast", "normal"), default="normal")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder)
        terminal = [in_terminal(options.picture, options.effort, out / f"run{k}") for k in range(3)]
        alone, beside = in_studio(options.picture, options.effort, out / "studio")
    print(
        f"{options.picture.name}, effort {options.effort}: seconds until the first certified tile"
    )
    print(f"terminal, from Enter (best of three) {min(terminal):6.1f}")
    print(f"studio, from asking                  {alone:6.1f}")
    print(f"studio, while another one searches   {beside:6.1f}")


if __name__ == "__main__":
    main()
