"""The operation that starts the studio."""

from __future__ import annotations

import errno
import secrets
import socket
import threading
import webbrowser
from contextlib import suppress
from importlib import import_module
from pathlib import Path

from orbiflow.errors import OrbiflowError, SettingError, literal
from orbiflow.runtime import NEVER, Cancel, Note, Outcome, Sink, ignore, make_folder, operation
from orbiflow.settings import naming_extras
from orbiflow.studio.settings import StudioSettings

PACKAGES = ("starlette", "uvicorn")


@operation("studio", starts_processes=True)
def studio(
    settings: StudioSettings = StudioSettings(), *, on_event: Sink = ignore, cancel: Cancel = NEVER
) -> Outcome:
    """Make tiles, solids and densities in a browser: a page that this very machine serves.

    Projects are kept, and searches that were not done go on when the studio is started again. The
    server ends with Ctrl-C.
    """
    with naming_extras("the studio"):
        for name in PACKAGES:
            import_module(name)
    token = "" if settings.is_local else secrets.token_urlsafe(24)

    from filelock import FileLock, Timeout
    from platformdirs import user_data_path

    folder = settings.data or user_data_path("orbiflow") / "studio"

    make_folder(folder, "give another folder as data")
    try:
        with FileLock(folder / "studio.lock", timeout=0):
            _serve(settings, folder, token, on_event, cancel)
    except Timeout:
        raise OrbiflowError(
            f"another studio is using {folder}; open its page, or give another folder as data"
        ) from None
    return Outcome({"folder": str(folder)})


def _serve(
    settings: StudioSettings, folder: Path, token: str, on_event: Sink, cancel: Cancel
) -> None:
    """Run the server until it is stopped."""
    from orbiflow.studio.app import create_app, serve
    from orbiflow.studio.store import Store
    from orbiflow.studio.work_queue import WorkQueue

    cancel.check()
    host = f"[{settings.host}]" if ":" in settings.host else settings.host
    address = f"http://{host}:{settings.port}/" + (f"?token={token}" if token else "")
    listener = _listening(settings.host, settings.port)
    store = Store(folder)
    app = create_app(store, WorkQueue(store), port=settings.port, token=token)
    on_event(Note(f"the studio is at {address} and keeps its projects in {folder}; Ctrl-C ends it"))
    if settings.browser:
        threading.Thread(target=webbrowser.open, args=(address,), daemon=True).start()
    with listener, suppress(KeyboardInterrupt):
        serve(app, listener)


def _listening(host: str, port: int) -> socket.socket:
    """Return a socket that listens at an address of this machine."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    name = literal(host)
    try:
        socket.getaddrinfo(host, port, family)
        return socket.create_server((host, port), family=family, backlog=256)
    except (OSError, UnicodeError) as error:
        why = literal((getattr(error, "strerror", None) or "no such name").partition(" (")[0])
        text = f"{name} {{port}} {port} cannot be used ({why}); give another {{port}}"
        unknown = isinstance(error, socket.gaierror | UnicodeError)
        if unknown or error.errno == errno.EADDRNOTAVAIL:
            text = f"{{host}} {name} is no address of this machine ({why}); leave {{host}} out"
        raise SettingError(text) from error
