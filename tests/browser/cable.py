"""A cable between a page and its server that can be cut."""

import asyncio
import threading


class Cable:
    """Passes every byte on to a port of this machine, from a port of its own, until it is cut."""

    def __init__(self, port):
        self.to, self.whole, self.port, self._ends = port, True, 0, []
        self._loop = asyncio.new_event_loop()
        self._ready = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()
        assert self._ready.wait(10.0)

    def _run(self):
        asyncio.set_event_loop(self._loop)
        server = self._loop.run_until_complete(asyncio.start_server(self._joined, "127.0.0.1", 0))
        self.port = server.sockets[0].getsockname()[1]
        self._ready.set()
        self._loop.run_forever()
        server.close()

    async def _joined(self, reader, writer):
        if not self.whole:
            writer.transport.abort()
            return
        try:
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self.to)
        except OSError:
            writer.transport.abort()
            return
        self._ends += [writer, far_writer]
        await asyncio.gather(self._pass(reader, far_writer), self._pass(far_reader, writer))

    async def _pass(self, reader, writer):
        try:
            while chunk := await reader.read(65536):
                writer.write(chunk)
                await writer.drain()
        except (OSError, asyncio.IncompleteReadError):
            pass
        writer.close()

    def cut(self):
        """Cut it: all connections end at once, and none can be made."""
        self.whole = False
        self._loop.call_soon_threadsafe(lambda: [end.transport.abort() for end in self._ends])

    def mend(self):
        """Make it whole again."""
        self.whole = True

    def close(self):
        """Take it away."""
        self.cut()
        asyncio.run_coroutine_threadsafe(self._rest(), self._loop).result(10.0)
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join(10.0)

    async def _rest(self):
        others = [task for task in asyncio.all_tasks() if task is not asyncio.current_task()]
        await asyncio.wait(others, timeout=5.0) if others else None
