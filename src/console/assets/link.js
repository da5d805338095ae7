// The connection to the program: snapshots come in, the operator's requests go out. After a reload or a lost connection the
// page gets the present state at once.
const LONGEST_WAIT_MS = 2000;

export function connect(take, state) {
  const url = new URL("live", location.href);
  url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
  let socket;
  let waitMs = 100;
  const send = (message) => {
    if (socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify(message));
  };
  const open = () => {
    socket = new WebSocket(url);
    socket.addEventListener("open", () => {
      waitMs = 100;
      state("open");
    });
    socket.addEventListener("message", ({ data }) => {
      const message = JSON.parse(data);
      if (message === null) return;
      // Acknowledges what is numbered. Without acknowledgements the program sends no more, so that a slow page misses snapshots
      // instead of getting old ones.
      if (message.n !== undefined) send({ seen: message.n });
      take(message);
    });
    socket.addEventListener("close", ({ reason }) => {
      if (reason === "over") return state("over");
      state("lost");
      setTimeout(open, waitMs);
      waitMs = Math.min(2 * waitMs, LONGEST_WAIT_MS);
    });
  };
  open();
  return send;
}

/// Fits a canvas to its size on the screen; returns its drawing context, in CSS pixels.
export function surface(canvas) {
  const { clientWidth: width, clientHeight: height } = canvas;
  const scale = window.devicePixelRatio || 1;
  if (canvas.width !== Math.round(width * scale) || canvas.height !== Math.round(height * scale)) {
    canvas.width = Math.round(width * scale);
    canvas.height = Math.round(height * scale);
  }
  const pen = canvas.getContext("2d");
  pen.setTransform(scale, 0, 0, scale, 0, 0);
  pen.clearRect(0, 0, width, height);
  return { pen, width, height };
}
