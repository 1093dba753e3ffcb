// Prints every estimate of a running rig: number, status, age on arrival, and the beginning of Θ.
//
//   abs-web &                                           # of abs-service-client
//   node examples/javascript/states.mjs [http://127.0.0.1:8081] [sheet] [COUNT]
//
// Node 18 or newer, without packages. In a browser, EventSource does what `events` does here, and connects again by
// itself: see client/abs_client/web/page.html, which also draws the mesh.

const [server = "http://127.0.0.1:8081", tracker = "sheet", count = Infinity] = process.argv.slice(2);

async function* events(url) {
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`${url}: ${answer.status} ${answer.statusText}`);
  let text = "";
  for await (const part of answer.body.pipeThrough(new TextDecoderStream())) {
    const whole = (text + part).split("\n\n");
    text = whole.pop();
    for (const event of whole) {
      const [name, data] = event.split("\n").map((line) => line.slice(line.indexOf(": ") + 2));
      yield [name, JSON.parse(data)];
    }
  }
}

let printed = 0;
for await (const [name, state] of events(`${server}/states/${tracker}`)) {
  if (name !== "state") continue; // "topology" has the faces of the vertices that follow
  const vertices = new Float32Array(Uint8Array.from(Buffer.from(state.vertices, "base64")).buffer);
  // On the host of the cameras; elsewhere only the age that abs-web measured before it sent the estimate, state.age_s.
  // Before the first estimate there is none: STALE, with age_s null.
  const age_ms = Number(process.hrtime.bigint() - BigInt(state.t_host_ns)) / 1e6;
  const age = state.age_s === null ? "–" : age_ms.toFixed(1);
  const theta = state.theta.slice(0, 6).map((value) => value.toFixed(3));
  console.log(
    `${state.seq} ${state.status} here ${age} ms, ${vertices.length / 3} vertices, Θ[${state.theta.length}] = ${theta.join(" ")}`,
  );
  if (++printed >= count) process.exit();
}
