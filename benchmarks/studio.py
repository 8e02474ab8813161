"""What a live page costs: processor time of the server for each frame with one client, and from a slider to the flight.

    python benchmarks/studio.py [--windows 20]

Processor time is that of this process, not of a clock, so that other programs disturb it less; the least of many
windows counts. The client is a process of its own that only receives. Shares are of one core at 30 frames per second.
"""

import argparse
import os
import subprocess
import sys
import threading
import time

import numpy as np

FRAMES = 30.0
WINDOW = 1.0  # s
CASES = {
    "100 agents, links, trails, charts": ("vasarhelyi_2018/4ms", {"agents": 100}, "three nearest", 0.10),
    "100 agents, links by radio": ("vasarhelyi_2018/4ms", {"agents": 100}, "radio", None),
    "1000 agents, trails": (
        "vasarhelyi_2018/4ms", {"agents": 1000, "world.side": 800.0, "start.separation": 5.0}, "none", 0.15,
    ),
    "300 boids with rays in a city": ("kidger/city", {"agents": 300}, "none", 1.0),
    "two flights of 100, links": ("vasarhelyi_2018/4ms", {"agents": 100}, "three nearest", None),
}  # fmt: skip
CAMERA = {
    "type": "ViewerCameraMessage", "wxyz": (1.0, 0.0, 0.0, 0.0), "position": (0.0, 0.0, 9.0), "fov": 1.0, "near": 0.01,
    "far": 1000.0, "image_height": 800, "image_width": 1280, "look_at": (0.0, 0.0, 0.0),
    "up_direction": (0.0, 0.0, 1.0),
}  # fmt: skip


def connected(address):
    """A web socket that has been let in and has told of its camera."""
    import msgspec
    import viser
    from websockets.sync.client import connect

    subprotocol = f"viser-v{viser.__version__}"
    socket = connect(address.replace("http", "ws"), subprotocols=[subprotocol], compression=None, max_size=None)
    socket.send(msgspec.msgpack.encode(CAMERA))
    return socket


def drained(socket):
    """Receive until the other side closes."""
    from websockets.exceptions import ConnectionClosed

    try:
        while True:
            socket.recv()
    except ConnectionClosed:
        return


def receive(address):
    """Receive until the server ends."""
    drained(connected(address))


def opened(name, settings, links, against=None):
    """A page that flies in a thread, with a client and a counter of frames."""
    from airflock.studio.browser_view import BrowserView
    from airflock.studio.flight_page import FlightPage
    from airflock.studio.player import FlightRequest, Player

    player = Player(FlightRequest(name, settings, 1, compared_with=against))
    player.start()
    view = BrowserView("127.0.0.1", 0, player.where)
    page = FlightPage(player, view)
    page.scene.links, page.drawn = links, 0
    draw = page.frame

    def counted(chart):
        draw(chart)
        page.drawn += 1

    page.frame = counted
    threading.Thread(target=page.run, daemon=True).start()
    client = subprocess.Popen([sys.executable, __file__, "--client", view.address])
    end = time.monotonic() + 60.0
    while view.clients < 1 and time.monotonic() < end:
        time.sleep(0.1)
    if view.clients < 1:
        raise SystemExit("no client came in")
    time.sleep(2.0)
    return player, view, page, client


def load(case, windows):
    """Seconds of processor time a frame: the least and the median of many windows; frames drawn a second."""
    name, settings, links, _ = CASES[case]
    against = {"radio.delay": 2.0} if case.startswith("two") else None
    player, view, page, client = opened(name, settings, links, against)
    costs, rates, paces = [], [], []
    for _ in range(windows):
        frames, cpu, wall, flown = page.drawn, time.process_time(), time.perf_counter(), player.time
        time.sleep(WINDOW)
        count, spent = page.drawn - frames, time.perf_counter() - wall
        if count:
            costs.append((time.process_time() - cpu) / count)
            rates.append(count / spent)
            paces.append((player.time - flown) / spent)
    client.kill()
    page.stop()
    view.stop()
    return min(costs), float(np.median(costs)), max(rates), max(paces)


def latency(moves):
    """Milliseconds from the message of a slider that was moved to the number in force in the flight."""
    import msgspec
    from viser import _messages

    player, view, page, client = opened("vasarhelyi_2018/4ms", {"agents": 100}, "three nearest")
    handle = page.tuning._handles["model.p_rep"][0]
    socket = connected(view.address)
    threading.Thread(target=drained, args=(socket,), daemon=True).start()
    found = []
    for number in range(moves):
        value = 0.1 + 0.001 * number
        message = _messages.GuiUpdateMessage(uuid=handle._impl.uuid, updates={"value": value})
        raw = msgspec.msgpack.encode(message.as_serializable_dict([]))
        began = time.perf_counter()
        socket.send(raw)
        while abs(player.scenario.parameters.p_rep - value) > 1e-9 and time.perf_counter() < began + 2.0:
            time.sleep(0.0002)
        found.append(1e3 * (time.perf_counter() - began))
        time.sleep(0.037)
    socket.close()
    client.kill()
    page.stop()
    view.stop()
    return np.percentile(found, [50, 95])


def main():
    """Measure every case and print one line each."""
    given = argparse.ArgumentParser(description=__doc__)
    given.add_argument("--windows", type=int, default=20)
    given.add_argument("--client", default="")
    chosen = given.parse_args()
    if chosen.client:
        receive(chosen.client)
        return
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    for case, (*_, most) in CASES.items():
        least, median, rate, pace = load(case, chosen.windows)
        wanted = f", wanted at most {most:.0%}" if most else ""
        print(
            f"{case}: least {1e3 * least:.2f} ms a frame = {least * FRAMES:.1%} of a core{wanted}; median "
            f"{1e3 * median:.2f} ms; {rate:.1f} frames/s, {pace:.2f} times real time",
            flush=True,
        )
    half, most = latency(100)
    print(f"slider to flight: median {half:.1f} ms, 95 % below {most:.1f} ms (wanted: 20 ms)")
    print(f"load average {os.getloadavg()[0]:.1f}")


if __name__ == "__main__":
    main()
