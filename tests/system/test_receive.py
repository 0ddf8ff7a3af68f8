"""tessera-rig receive and journal, as cameras and users meet them."""
import csv
import io
import os
import resource
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest

TOP = Path(__file__).resolve().parents[2]
BIN = Path(os.environ.get("TESSERA_BIN", TOP / "build/bin"))
GOLDEN = TOP / "tests/golden/wire"
RIG = BIN / "tessera-rig"
sys.path.insert(0, str(TOP / "tests/wire"))
sys.path.insert(0, str(GOLDEN))
import decode as wire  # noqa: E402
import make_samples as maker  # noqa: E402

WAIT_S = 20  # far above what any of this takes: only a hang reaches it


def packet(camera, number, features=None):
    fields = maker.FULL | {"serial": camera, "packet_index": number, "sequence": number,
                           "t_capture_ns": 1000 * number, "truncation": 0, "frames_dropped": 0}
    return maker.build(fields, {number % 4096: features or {3: (4096 + number, 8192, 10, 9)}})


class Receiver:
    def __init__(self, folder, *options, timeout_s=WAIT_S, **popen):
        self.journal = folder / "a.journal"
        port_file = folder / "port"
        self.process = subprocess.Popen(
            [RIG, "receive", "--listen", "127.0.0.1:0", "--journal", self.journal,
             "--port-file", port_file, "--timeout", str(timeout_s), *options],
            stderr=subprocess.PIPE, text=True, **popen)
        end = time.monotonic() + WAIT_S
        while not port_file.exists():
            assert self.process.poll() is None, self.process.stderr.read()
            assert time.monotonic() < end
            time.sleep(0.01)
        self.port = int(port_file.read_text())

    def connect(self):
        return socket.create_connection(("127.0.0.1", self.port), timeout=WAIT_S)

    def send(self, data, piece=None):
        with self.connect() as camera:
            for at in range(0, len(data), piece or max(len(data), 1)):
                camera.sendall(data[at:at + piece] if piece else data)

    def end(self):
        """Exit status, and what was said."""
        _, said = self.process.communicate(timeout=WAIT_S)
        return self.process.returncode, said


def journal(command, path, status=0):
    run = subprocess.run([RIG, "journal", command, path], capture_output=True, text=True,
                         timeout=WAIT_S)
    assert run.returncode == status, run.stderr
    return run.stdout


def rows(text):
    return list(csv.DictReader(io.StringIO(text)))


def test_three_cameras_at_once_lose_nothing(tmp_path):
    receiver = Receiver(tmp_path, "--cameras", "3")
    count = 200
    streams = {f"cam{i}": b"".join(packet(f"cam{i}", n) for n in range(count)) for i in range(3)}
    # Pieces that never end where a packet does.
    threads = [threading.Thread(target=receiver.send, args=(data, 997 + 10 * k))
               for k, data in enumerate(streams.values())]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    status, said = receiver.end()
    assert status == 0, said
    for name in streams:
        assert f"{name}: {count} packets, {count} features" in said
    listed = rows(journal("list", receiver.journal))
    for name in streams:
        assert [int(r["packet"]) for r in listed if r["camera"] == name] == list(range(count))
    assert journal("check", receiver.journal).startswith(f"{receiver.journal}: {3 * count} good")


def test_features_come_out_as_a_decoder_of_the_document_finds_them(tmp_path):
    names = ["good_full", "good_level3", "good_extreme", "good_empty", "good_longer_header"]
    samples = [wire.read_hex(GOLDEN / f"{name}.hex") for name in names]
    receiver = Receiver(tmp_path, "--until-closed")
    receiver.send(b"".join(samples))
    assert receiver.end()[0] == 0
    found = rows(journal("csv", receiver.journal))
    expected = [(packet["header"]["serial"], feature)
                for packet in map(wire.decode, samples) for feature in wire.pixels(packet)]
    assert len(found) == len(expected)
    for row, (serial, (patch, feature, x, y, sigma, size)) in zip(found, expected):
        assert (row["camera"], int(row["patch"]), int(row["feature"])) == (serial, patch, feature)
        # Printed with 6 decimals: half of the last.
        assert abs(float(row["x"]) - x) <= 0.51e-6 and abs(float(row["y"]) - y) <= 0.51e-6
        assert abs(float(row["sigma"]) - sigma) <= 0.6e-6
        assert abs(float(row["size"]) - size) <= 0.6e-3


@pytest.mark.parametrize("path", sorted(GOLDEN.glob("bad_*.hex")), ids=lambda path: path.stem)
def test_a_bad_packet_is_left_out_and_the_good_ones_around_it_stay(path, tmp_path):
    bad = wire.read_hex(path)
    # Enough behind it that even a length that is too great is seen to be wrong.
    receiver = Receiver(tmp_path, "--until-closed")
    receiver.send(packet("c", 1) + bad + b"".join(packet("c", n) for n in range(2, 8)))
    status, said = receiver.end()
    # With a byte too many behind it, a packet is a good one on a stream, and that byte is skipped.
    listed = rows(journal("list", receiver.journal))
    assert [int(r["packet"]) for r in listed if r["camera"] == "c"] == [1, 2, 3, 4, 5, 6, 7]
    assert status == (0 if not bad else 1), said
    if bad:
        assert "1 fault on connections" in said.splitlines()[-1]


def test_a_truncated_packet_is_said_and_all_others_are_kept(tmp_path):
    receiver = Receiver(tmp_path, "--cameras", "2")
    receiver.send(packet("a", 0) + packet("a", 1)[:-1])
    receiver.send(packet("b", 0))
    status, said = receiver.end()
    assert status == 1
    assert "of a packet, which is left out" in said.splitlines()[-1]
    assert [r["camera"] for r in rows(journal("list", receiver.journal))] == ["a", "b"]


def test_endless_garbage_is_cut_off_while_others_go_on(tmp_path):
    receiver = Receiver(tmp_path, "--until-closed")
    with receiver.connect() as good:
        good.sendall(packet("good", 0))
        with receiver.connect() as bad:
            with pytest.raises(OSError):
                for _ in range(1000):
                    bad.sendall(b"GET / HTTP/1.1\r\n" * 10000)
        good.sendall(packet("good", 1))
    status, said = receiver.end()
    assert status == 1
    assert "bytes that belong to no packet" in said
    assert len(rows(journal("list", receiver.journal))) == 2


def test_one_serial_on_two_connections_is_reported(tmp_path):
    receiver = Receiver(tmp_path, "--until-closed")
    with receiver.connect() as one, receiver.connect() as two:
        one.sendall(packet("twin", 0))
        time.sleep(0.2)
        two.sendall(packet("twin", 0))
        time.sleep(0.2)
    status, said = receiver.end()
    assert "call themselves twin" in said
    assert status == 0


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_it_cleanly(number, tmp_path):
    receiver = Receiver(tmp_path)
    with receiver.connect() as camera:
        camera.sendall(packet("c", 0) + packet("c", 1))
        time.sleep(0.5)
        receiver.process.send_signal(number)
        status, said = receiver.end()
    assert status == 0, said
    assert len(rows(journal("list", receiver.journal))) == 2


def test_being_killed_loses_nothing_that_was_received(tmp_path):
    receiver = Receiver(tmp_path)
    with receiver.connect() as camera:
        camera.sendall(packet("c", 0) + packet("c", 1))
        time.sleep(0.5)
        receiver.process.kill()
        receiver.end()
    assert len(rows(journal("list", receiver.journal))) == 2


def test_silence_is_a_failure_after_the_time_out(tmp_path):
    receiver = Receiver(tmp_path, "--cameras", "2", timeout_s=0.5)
    status, said = receiver.end()
    assert status == 1
    assert "nothing came for 0.5 s" in said.splitlines()[-1]


def test_a_full_disk_ends_it_with_a_sentence_and_keeps_what_came(tmp_path):
    one = len(packet("c", 0)) + 32 + len("127.0.0.1:50000")

    def small_files():
        resource.setrlimit(resource.RLIMIT_FSIZE, (32 + 10 * one, resource.RLIM_INFINITY))

    receiver = Receiver(tmp_path, "--until-closed", preexec_fn=small_files)
    try:
        receiver.send(b"".join(packet("c", n) for n in range(200)))
    except OSError:
        pass  # the receiver may be gone before all is sent
    status, said = receiver.end()
    assert status == 1
    assert said.splitlines()[-1].startswith(f"tessera-rig: {receiver.journal}: File too large")
    listed = [int(r["packet"]) for r in rows(journal("list", receiver.journal))]
    assert len(listed) in (9, 10) and listed == list(range(len(listed)))


@pytest.fixture
def small_disk(tmp_path):
    folder = tmp_path / "disk"
    folder.mkdir()
    mount = subprocess.run(["mount", "-t", "tmpfs", "-o", "size=64k", "tmpfs", folder],
                           capture_output=True)
    if mount.returncode != 0:
        pytest.skip("mounting a small disk needs root")
    yield folder
    subprocess.run(["umount", folder], check=True)


def test_a_disk_that_fills_up_keeps_what_came(small_disk):
    receiver = Receiver(small_disk, "--until-closed")
    try:
        receiver.send(b"".join(packet("c", n) for n in range(2000)))
    except OSError:
        pass
    status, said = receiver.end()
    assert status == 1
    assert "No space left on device" in said.splitlines()[-1]
    listed = [int(r["packet"]) for r in rows(journal("list", receiver.journal))]
    assert len(listed) > 100 and listed == list(range(len(listed)))


def fails(status, *arguments):
    run = subprocess.run([RIG, *arguments], capture_output=True, text=True, timeout=WAIT_S)
    assert run.returncode == status, run.stderr
    assert run.stdout == ""
    return run.stderr


def test_wrong_use_is_status_2():
    fails(2)
    fails(2, "receive")
    fails(2, "receive", "--listen", "127.0.0.1:0")
    fails(2, "receive", "--listen", "127.0.0.1:0", "--journal", "x", "--cameras", "0")
    fails(2, "journal")
    fails(2, "journal", "check")


@pytest.mark.parametrize("address", ["nonsense", "127.0.0.1:", "127.0.0.1:70000", "192.0.2.1:0",
                                     "::1:7400"])
def test_an_address_that_is_none_of_ours_gets_one_sentence(address, tmp_path):
    said = fails(1, "receive", "--listen", address, "--journal", tmp_path / "j")
    assert len(said.splitlines()) == 1 and address in said
    assert not (tmp_path / "j").exists()


def test_a_port_in_use_gets_one_sentence(tmp_path):
    with socket.create_server(("127.0.0.1", 0)) as taken:
        address = f"127.0.0.1:{taken.getsockname()[1]}"
        said = fails(1, "receive", "--listen", address, "--journal", tmp_path / "j")
    assert len(said.splitlines()) == 1 and "in use" in said


def test_a_journal_that_cannot_be_written_gets_one_sentence(tmp_path):
    (tmp_path / "there").write_text("something else")
    for path in ["/dev/full", tmp_path / "none/j", tmp_path / "there", tmp_path]:
        said = fails(1, "receive", "--listen", "127.0.0.1:0", "--journal", path)
        assert len(said.splitlines()) == 1 and str(path) in said
    assert (tmp_path / "there").read_text() == "something else"


def test_appending_goes_on_behind_a_torn_tail(tmp_path):
    receiver = Receiver(tmp_path, "--until-closed")
    receiver.send(packet("c", 0) + packet("c", 1))
    assert receiver.end()[0] == 0
    os.truncate(receiver.journal, receiver.journal.stat().st_size - 5)
    (tmp_path / "port").unlink()
    receiver = Receiver(tmp_path, "--until-closed", "--append")
    receiver.send(packet("c", 2))
    status, said = receiver.end()
    assert status == 0 and "holds 1 records" in said
    assert [int(r["packet"]) for r in rows(journal("list", receiver.journal))] == [0, 2]


def test_a_damaged_journal_still_gives_its_good_records(tmp_path):
    receiver = Receiver(tmp_path, "--until-closed")
    receiver.send(b"".join(packet("c", n) for n in range(3)))
    assert receiver.end()[0] == 0
    data = bytearray(receiver.journal.read_bytes())
    data[len(data) // 2] ^= 1
    receiver.journal.write_bytes(data)
    listed = rows(journal("list", receiver.journal, status=1))
    assert [int(r["packet"]) for r in listed] == [0, 2]
    journal("check", receiver.journal, status=1)


def test_a_foreign_file_is_no_journal(tmp_path):
    (tmp_path / "x").write_text("a,b\n1,2\n")
    said = fails(1, "journal", "csv", tmp_path / "x")
    assert "not a journal" in said and len(said.splitlines()) == 1


def test_a_port_of_zero_is_printed(tmp_path):
    process = subprocess.Popen([RIG, "receive", "--listen", "127.0.0.1:0", "--quiet",
                                "--journal", tmp_path / "j"], stdout=subprocess.PIPE, text=True)
    port = int(process.stdout.readline())
    socket.create_connection(("127.0.0.1", port), timeout=WAIT_S).close()
    process.send_signal(signal.SIGTERM)
    assert process.wait(timeout=WAIT_S) == 0
    process.stdout.close()
