"""Drag a file onto a window and drop it there, as a file manager does: the source of the protocol XDND on X11.

python3 drag_source.py FILE X Y

X and Y are pixels of the screen from its top left. Needs the library of X11 only. The exit code is 0 if the window
reported the end of the drop.
"""

import ctypes
import sys
import time
from pathlib import Path

X11 = ctypes.CDLL("libX11.so.6")
XID = ctypes.c_ulong
CLIENT_MESSAGE, SELECTION_NOTIFY, SELECTION_REQUEST = 33, 31, 30
SECONDS = 20.0  # to wait for an answer

for name, result, arguments in (
    ("XOpenDisplay", ctypes.c_void_p, [ctypes.c_char_p]),
    ("XDefaultRootWindow", XID, [ctypes.c_void_p]),
    ("XInternAtom", XID, [ctypes.c_void_p, ctypes.c_char_p, ctypes.c_int]),
    ("XCreateSimpleWindow", XID, [ctypes.c_void_p, XID, *[ctypes.c_int] * 2, *[ctypes.c_uint] * 3, XID, XID]),
    ("XSetSelectionOwner", ctypes.c_int, [ctypes.c_void_p, XID, XID, XID]),
    ("XPending", ctypes.c_int, [ctypes.c_void_p]),
    ("XNextEvent", ctypes.c_int, [ctypes.c_void_p, ctypes.c_void_p]),
    ("XFlush", ctypes.c_int, [ctypes.c_void_p]),
    ("XFree", ctypes.c_int, [ctypes.c_void_p]),
    ("XSendEvent", ctypes.c_int, [ctypes.c_void_p, XID, ctypes.c_int, ctypes.c_long, ctypes.c_void_p]),
    ("XQueryTree", ctypes.c_int, [ctypes.c_void_p, XID, *[ctypes.c_void_p] * 4]),
    ("XListProperties", ctypes.c_void_p, [ctypes.c_void_p, XID, ctypes.c_void_p]),
    (
        "XChangeProperty",
        ctypes.c_int,
        [ctypes.c_void_p, XID, XID, XID, *[ctypes.c_int] * 2, ctypes.c_char_p, ctypes.c_int],
    ),
):
    function = getattr(X11, name)
    function.restype, function.argtypes = result, arguments


class Message(ctypes.Structure):
    """XClientMessageEvent."""

    _fields_ = [
        ("type", ctypes.c_int),
        ("serial", ctypes.c_ulong),
        ("send_event", ctypes.c_int),
        ("display", ctypes.c_void_p),
        ("window", XID),
        ("message_type", XID),
        ("format", ctypes.c_int),
        ("data", ctypes.c_long * 5),
    ]


class Request(ctypes.Structure):
    """XSelectionRequestEvent."""

    _fields_ = [
        *Message._fields_[:4],
        ("owner", XID),
        ("requestor", XID),
        ("selection", XID),
        ("target", XID),
        ("property", XID),
        ("time", XID),
    ]


class Answer(ctypes.Structure):
    """XSelectionEvent."""

    _fields_ = [*Message._fields_[:4], *Request._fields_[5:]]


class Event(ctypes.Union):
    """XEvent."""

    _fields_ = [("message", Message), ("request", Request), ("answer", Answer), ("size", ctypes.c_long * 24)]


class Drag:
    """A drag of one file."""

    def __init__(self, uri):
        self.uri = uri
        self.display = X11.XOpenDisplay(None) or sys.exit("no display")
        root = X11.XDefaultRootWindow(self.display)
        self.window = X11.XCreateSimpleWindow(self.display, root, 0, 0, 1, 1, 0, 0, 0)
        X11.XSetSelectionOwner(self.display, self.atom("XdndSelection"), self.window, 0)
        self.target = self.aware(root) or sys.exit("no window accepts drops")

    def atom(self, name):
        """Return the number of a name."""
        return X11.XInternAtom(self.display, name.encode(), 0)

    def aware(self, window):
        """Return the window that accepts drops, among one and those in it; None without one."""
        count = ctypes.c_int()
        listed = X11.XListProperties(self.display, window, ctypes.byref(count))
        if listed:
            properties = ctypes.cast(listed, ctypes.POINTER(XID))[: count.value]
            X11.XFree(listed)
            if self.atom("XdndAware") in properties:
                return window
        root, parent, children, number = XID(), XID(), ctypes.POINTER(XID)(), ctypes.c_uint()
        X11.XQueryTree(self.display, window, *map(ctypes.byref, (root, parent, children, number)))
        return next(filter(None, (self.aware(child) for child in children[: number.value])), None)

    def send(self, name, *data):
        """Send a message of the protocol to the target."""
        event = Event()
        event.message = Message(CLIENT_MESSAGE, 0, 1, self.display, self.target, self.atom(name), 32)
        event.message.data[:] = [self.window, *data, *[0] * (4 - len(data))]
        X11.XSendEvent(self.display, self.target, 0, 0, ctypes.byref(event))
        X11.XFlush(self.display)

    def answer(self, request):
        """Give the address of the file to the window that asks for it."""
        X11.XChangeProperty(
            self.display, request.requestor, request.property, request.target, 8, 0, self.uri, len(self.uri)
        )
        event = Event()
        event.answer = Answer(
            SELECTION_NOTIFY,
            0,
            1,
            self.display,
            request.requestor,
            request.selection,
            request.target,
            request.property,
            request.time,
        )
        X11.XSendEvent(self.display, request.requestor, 0, 0, ctypes.byref(event))
        X11.XFlush(self.display)

    def until(self, name):
        """Answer requests until the target sends a message with this name, and return its data."""
        end = time.monotonic() + SECONDS
        while time.monotonic() < end:
            if not X11.XPending(self.display):
                time.sleep(0.01)
                continue
            event = Event()
            X11.XNextEvent(self.display, ctypes.byref(event))
            if event.message.type == SELECTION_REQUEST:
                self.answer(event.request)
            elif event.message.type == CLIENT_MESSAGE and event.message.message_type == self.atom(name):
                return list(event.message.data)
        sys.exit(f"no {name} within {SECONDS:g} s")


def main():
    """Enter the window, move to the place, and drop."""
    drag = Drag((Path(sys.argv[1]).resolve().as_uri() + "\r\n").encode())
    x, y = map(int, sys.argv[2:])
    drag.send("XdndEnter", 3 << 24, drag.atom("text/uri-list"))
    for _ in range(2):  # the first one enters
        drag.send("XdndPosition", 0, x << 16 | y, 0, drag.atom("XdndActionCopy"))
        accepted = drag.until("XdndStatus")[1] & 1
    if not accepted:
        sys.exit("the window does not accept the file")
    drag.send("XdndDrop", 0)
    drag.until("XdndFinished")


if __name__ == "__main__":
    main()
