"""Rests on the real clock: ports are heard however late a life is, and neither a flood nor a lost line stops it."""

import os
import pty
import socket
import threading
import time

import pytest

from airflock.drones.onboard import node_program
from airflock.drones.onboard.node_program import SerialPort, TaskRest, UdpAddresses, UdpPort, run_alone

HOST = "127.0.0.1"


@pytest.fixture
def port():
    found = UdpPort(UdpAddresses((HOST, 0), None))
    yield found
    found.close()


def test_a_life_that_is_late_hears_its_ports_at_each_rest(port):
    heard, count = [], 5

    def life():
        hears = [(port, lambda data, now: heard.append((data, now)))]
        for number in range(count):
            port.send(bytes([number]), port.here)
            yield TaskRest(time.monotonic() - 1.0, hears)
            assert len(heard) == number + 1, "loopback delivers before it returns"
        return "ended"

    assert run_alone(life()) == "ended"
    assert [data for data, _ in heard] == [bytes([number]) for number in range(count)]
    assert [now for _, now in heard] == sorted(now for _, now in heard)


def test_a_rest_ends_at_its_time_and_no_sooner(port):
    def life():
        for rest in (0.0, 0.003, 0.02):
            until = time.monotonic() + rest
            yield TaskRest(until)
            assert time.monotonic() >= until

    run_alone(life())


def test_a_flood_is_read_in_portions(port, monkeypatch):
    """Whoever sends faster than a node reads must not keep it from its tick."""
    monkeypatch.setattr(node_program, "MAX_DATAGRAMS", 10)
    for number in range(25):
        port.send(bytes([number]), port.here)
    portions = [[data[0] for data in port.read()] for _ in range(4)]
    assert portions == [list(range(10)), list(range(10, 20)), list(range(20, 25)), []]


@pytest.fixture
def others():
    """Three processes of this computer that may send to a port."""
    made = [UdpPort(UdpAddresses((HOST, 0), None)) for _ in range(3)]
    yield made
    for each in made:
        each.close()


def test_port_of_an_autopilot_answers_the_first_that_speaks_as_it_until_that_is_silent(port, others, monkeypatch):
    """Nobody else can draw its commands to itself, nor be read as the autopilot."""
    autopilot, rival, stranger = others
    notes, ours, junk = [], b"a heartbeat", b"\xfd or anything"
    port.answer(lambda data: data == ours, notes.append)
    assert not port.write(b"nobody is there")

    def arrives(sender, data):
        sender.send(data, port.here)
        return data in port.read() and port.write(b"answer")

    assert not arrives(stranger, junk) and not notes
    assert arrives(autopilot, ours) and autopilot.read() == [b"answer"] and not stranger.read()
    for _ in range(3):
        assert not arrives(rival, ours) and not arrives(stranger, junk)
        assert arrives(autopilot, junk) and len(autopilot.read()) == 1
    assert not rival.read() and not stranger.read()
    assert [note.split(" ", 1)[1] for note in notes[1:]] == ["speaks as this autopilot, too: nothing of it is read"]
    later = time.monotonic() + node_program.PARTNER_SILENCE + 0.1
    monkeypatch.setattr(node_program.time, "monotonic", lambda: later)  # it has restarted meanwhile
    assert arrives(rival, ours) and rival.read() == [b"answer"]
    assert not arrives(autopilot, ours) and not autopilot.read()
    assert notes[-1] == "the autopilot is heard from {}:{}; commands go there".format(*rival.here)


def test_port_with_a_destination_sends_there_whatever_arrives(others):
    partner, rival, _ = others
    with_destination = UdpPort(UdpAddresses((HOST, 0), partner.here))
    with_destination.answer(lambda data: True, lambda note: None)
    rival.send(b"a heartbeat", with_destination.here)
    assert with_destination.read() == [b"a heartbeat"] and with_destination.write(b"answer")
    assert partner.read() == [b"answer"] and not rival.read()
    with_destination.close()


def test_while_somebody_floods_a_port_a_life_goes_on(port):
    over, ticks = threading.Event(), 5

    def flood():
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as out:
            while not over.is_set():
                out.sendto(bytes(100), port.here)

    def life():
        hears = [(port, lambda data, now: None)]
        for _ in range(ticks):
            yield TaskRest(time.monotonic() + 0.01, hears)
        return ticks

    beside = threading.Thread(target=flood)
    beside.start()
    try:
        assert run_alone(life()) == ticks
    finally:
        over.set()
        beside.join()


def test_a_serial_line_that_is_pulled_out_says_nothing_and_wakes_nobody():
    master, slave = pty.openpty()
    line = SerialPort(f"{os.ttyname(slave)}:57600", "serial:")
    heard, looks = [], []
    read = line.read

    def counted():
        looks.append(time.monotonic())
        return read()

    line.read = counted

    def life():
        hears = [(line, lambda data, now: heard.append(data))]
        os.write(master, b"last words")
        yield TaskRest(time.monotonic(), hears)
        os.close(slave)
        os.close(master)
        for _ in range(20):
            yield TaskRest(time.monotonic() + 0.002, hears)

    run_alone(life())
    line.close()
    assert b"".join(heard) == b"last words"
    assert len(looks) <= 4, "an end that is told again and again would take the whole processor"
