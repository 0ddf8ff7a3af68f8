"""A small V4L2 camera client, run as a program of its own under tessera-replay.

Prints a JSON line for each thing that happens; options choose what it does. It is written from the
V4L2 documentation alone, so that it can judge both the shim and the capture module.
"""
import argparse
import ctypes
import errno
import fcntl
import hashlib
import json
import mmap
import os
import sys
import time


class Pixels(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint32) for name in (
        "width", "height", "fourcc", "field", "bytesperline", "sizeimage", "colorspace", "priv",
        "flags", "ycbcr", "quantization", "xfer")]


class FormatUnion(ctypes.Union):
    _fields_ = [("pix", Pixels), ("raw", ctypes.c_uint8 * 200), ("align", ctypes.c_void_p)]


class Format(ctypes.Structure):
    _fields_ = [("type", ctypes.c_uint32), ("fmt", FormatUnion)]


class Request(ctypes.Structure):
    _fields_ = [(name, ctypes.c_uint32) for name in (
        "count", "type", "memory", "capabilities", "flags")]


class Time(ctypes.Structure):
    _fields_ = [("s", ctypes.c_long), ("us", ctypes.c_long)]


class Where(ctypes.Union):
    _fields_ = [("offset", ctypes.c_uint32), ("userptr", ctypes.c_ulong)]


class Buffer(ctypes.Structure):
    _fields_ = [
        ("index", ctypes.c_uint32), ("type", ctypes.c_uint32), ("bytesused", ctypes.c_uint32),
        ("flags", ctypes.c_uint32), ("field", ctypes.c_uint32), ("timestamp", Time),
        ("timecode", ctypes.c_uint32 * 4), ("sequence", ctypes.c_uint32),
        ("memory", ctypes.c_uint32), ("m", Where), ("length", ctypes.c_uint32),
        ("reserved2", ctypes.c_uint32), ("request_fd", ctypes.c_int32)]


def io(direction, number, kind):
    return direction << 30 | ctypes.sizeof(kind) << 16 | ord("V") << 8 | number


G_FMT = io(3, 4, Format)
REQBUFS = io(3, 8, Request)
QUERYBUF = io(3, 9, Buffer)
QBUF = io(3, 15, Buffer)
DQBUF = io(3, 17, Buffer)
STREAMON = io(1, 18, ctypes.c_int)
STREAMOFF = io(1, 19, ctypes.c_int)
CAPTURE, MMAP = 1, 1


def say(**what):
    print(json.dumps(what), flush=True)


def stream(fd, memory, frames, pause_s):
    """One STREAMON to STREAMOFF."""
    for index in range(len(memory)):
        fcntl.ioctl(fd, QBUF, Buffer(index=index, type=CAPTURE, memory=MMAP))
    fcntl.ioctl(fd, STREAMON, ctypes.c_int(CAPTURE))
    for _ in range(frames):
        buffer = Buffer(type=CAPTURE, memory=MMAP)
        try:
            fcntl.ioctl(fd, DQBUF, buffer)
        except OSError as error:
            say(error=errno.errorcode[error.errno])
            break
        pixels = memory[buffer.index][:buffer.bytesused]
        say(sequence=buffer.sequence, index=buffer.index, flags=buffer.flags,
            us=buffer.timestamp.s * 1000000 + buffer.timestamp.us,
            digest=hashlib.sha256(pixels).hexdigest())
        time.sleep(pause_s)
        fcntl.ioctl(fd, QBUF, buffer)
    fcntl.ioctl(fd, STREAMOFF, ctypes.c_int(CAPTURE))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--device", default="/dev/video0")
    parser.add_argument("--frames", type=int, default=1)
    parser.add_argument("--streams", type=int, default=1)
    parser.add_argument("--buffers", type=int, default=3)
    parser.add_argument("--pause", type=float, default=0.0)
    options = parser.parse_args()
    fd = os.open(options.device, os.O_RDWR)
    form = Format(type=CAPTURE)
    fcntl.ioctl(fd, G_FMT, form)
    pix = form.fmt.pix
    say(width=pix.width, height=pix.height, fourcc=pix.fourcc.to_bytes(4, "little").decode(),
        bytesperline=pix.bytesperline, sizeimage=pix.sizeimage)
    request = Request(count=options.buffers, type=CAPTURE, memory=MMAP)
    fcntl.ioctl(fd, REQBUFS, request)
    memory = []
    for index in range(request.count):
        buffer = Buffer(index=index, type=CAPTURE, memory=MMAP)
        fcntl.ioctl(fd, QUERYBUF, buffer)
        memory.append(mmap.mmap(fd, buffer.length, mmap.MAP_SHARED, offset=buffer.m.offset))
    for _ in range(options.streams):
        stream(fd, memory, options.frames, options.pause)
    return 0


if __name__ == "__main__":
    sys.exit(main())
