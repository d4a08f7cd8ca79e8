// The page of the box: what it does, the plants it has, one plant in 3D. Talks to the API of the same program only.

const POLL_MS = 2000;
const $ = (id) => document.getElementById(id);
const TRAITS = {
  height: "Height", leaf_count: "Leaves", blade_count: "Blades", blade_count_visible: "Blades seen",
  leaf_area: "Leaf area", leaf_length: "Leaf length", leaf_width: "Leaf width", leaf_inclination: "Leaf inclination",
  leaf_azimuth: "Leaf azimuth", leaf_insertion_angle: "Leaf insertion angle", leaf_curvature: "Leaf curvature",
  petiole_length: "Petiole length", petiole_angle: "Petiole angle", internode_length: "Internode length",
  stem_diameter: "Stem diameter", stem_length: "Stem length", stem_lean: "Stem lean", branch_order: "Branch order",
  hull_volume: "Hull volume", projected_area: "Projected area", lai: "Leaf area index",
};
// What people read instead of SI: factor, unit, digits.
const UNITS = {
  m: [100, "cm", 1], m2: [1e4, "cm²", 1], m3: [1e6, "cm³", 0], rad: [180 / Math.PI, "°", 0], 1: [1, "", 1], "1/m": [1, "1/m", 1],
};
const STATES = {
  working: ["good", "Working", "Frames become plants."],
  finished: ["good", "Done", "The recording has been read to its end."],
  idle: ["wait", "Waiting", "No camera or recording is configured. Stored plants are shown."],
  failed: ["bad", "Stopped", ""],
};
// Where something is wrong, its colour and its reasons stand instead.
const WRONG = { degraded: "wait", broken: "bad" };

const CAMERA_WORDS = { starting: "starting", streaming: "works", lost: "no frames" };

let known = null; // Plants in the store at the last look: the list is fetched again when it changes.
let next = null;

async function ask(path) {
  const response = await fetch(path);
  const body = await response.json();
  if (!response.ok) throw new Error(body.error.message);
  return body;
}

const plantPath = (id, part = "") => `/api/v1/plants/${encodeURIComponent(id)}${part}`;
const number = (value, factor, digits) => (value == null ? "–" : (value * factor).toFixed(digits));
const time = (text) => {
  const at = new Date(text);
  return Number.isNaN(at.getTime()) ? text : at.toLocaleString(undefined, { dateStyle: "short", timeStyle: "short" });
};

function show(colour, word, text) {
  $("state").className = colour;
  $("state-word").textContent = word;
  $("state-text").textContent = text;
}

async function poll() {
  try {
    const status = await ask("/api/v1/status");
    const [colour, word, text] = STATES[status.health === "broken" ? "failed" : status.activity.state];
    const reasons = status.reasons.map((reason) => reason.message).join(". ");
    show(WRONG[status.health] ?? colour, word, reasons || (status.activity.message ?? text));
    const stage = ({ name, busy_seconds: busy, stuck }) =>
      cell(`${name}: ${stuck ? "stuck" : busy == null ? "waiting" : "busy"}`, "li");
    $("stages").replaceChildren(...status.stages.map(stage));
    cameras(status.cameras);
    $("clock").textContent = status.time_trusted ? "" : "The clock is not set: times may be wrong.";
    $("position").textContent = position(status.position);
    $("count-plants").textContent = status.store.plants;
    $("count-unsent").textContent = status.store.unsent;
    $("count-last").textContent = status.store.last_plant ? time(status.store.last_plant) : "none yet";
    if (status.store.plants !== known) {
      await list(null);
      known = status.store.plants;
    }
  } catch (error) {
    show("bad", "No answer", `The box does not answer: ${error.message}`);
  }
  setTimeout(poll, POLL_MS);
}

function position(receiver) {
  if (!receiver?.last || receiver.state !== "fix") return "";
  const { quality, accuracy_m: accuracy } = receiver.last;
  return `Position: ${quality.replace("_", " ")}${accuracy == null ? "" : `, ± ${accuracy.toFixed(2)} m`}`;
}

// Cards stay where they are from one look to the next, so that their pictures do not flicker.
function cameras(all) {
  const cards = new Map([...$("cameras").children].map((card) => [card.dataset.id, card]));
  $("cameras").replaceChildren(...all.map((camera) => look(cards.get(camera.id) ?? card(camera.id), camera)));
}

function card(id) {
  const card = document.createElement("figure");
  const picture = document.createElement("img");
  card.dataset.id = id;
  picture.alt = `What camera ${id} sees`;
  picture.hidden = true;
  picture.onload = () => { picture.hidden = false; };
  card.append(picture, cell("", "figcaption"));
  return card;
}

function look(card, camera) {
  const [picture, caption] = card.children;
  // Nobody looks at a page in the background, and a picture that is still on its way is not asked for twice.
  if (!document.hidden && picture.complete) picture.src = `/api/v1/cameras/${encodeURIComponent(camera.id)}/preview.jpg?${Date.now()}`;
  const lost = camera.missed + camera.dropped + camera.damaged;
  const facts = [CAMERA_WORDS[camera.state], camera.rate && `${camera.rate.toFixed(1)} frames/s`, `${camera.frames} frames`, lost && `${lost} lost`];
  const wrong = camera.lens ?? (camera.state === "lost" ? camera.last_error : null);
  caption.replaceChildren(cell(camera.id, "strong"), cell(facts.filter(Boolean).join(", "), "span"), ...(wrong ? [cell(wrong, "em")] : []));
  card.className = wrong ? "wrong" : "";
  return card;
}

async function list(cursor) {
  const page = await ask(`/api/v1/plants${cursor == null ? "" : `?cursor=${cursor}`}`);
  const rows = page.plants.map(row);
  if (cursor == null) $("rows").replaceChildren(...rows);
  else $("rows").append(...rows);
  next = page.next;
  $("more").hidden = next == null;
  $("empty").hidden = $("rows").children.length > 0;
  choose();
}

function cell(text, tag = "td") {
  const cell = document.createElement(tag);
  cell.textContent = text;
  return cell;
}

function row(plant) {
  const row = document.createElement("tr");
  row.dataset.id = plant.id;
  row.tabIndex = 0;
  row.append(
    cell(plant.id), cell(number(plant.leaf_count, 1, 0)), cell(number(plant.height, 100, 1)),
    cell(number(plant.leaf_area, 1e4, 1)), cell(plant.time_trusted ? time(plant.time) : `${time(plant.time)} (clock not set)`),
  );
  row.onclick = () => { location.hash = encodeURIComponent(plant.id); };
  row.onkeydown = (event) => { if (event.key === "Enter") row.onclick(); };
  return row;
}

function choose() {
  const id = decodeURIComponent(location.hash.slice(1));
  for (const row of $("rows").children) row.classList.toggle("chosen", row.dataset.id === id);
  return id;
}

async function plant() {
  const id = choose();
  $("plant").hidden = !id;
  if (!id) return;
  $("plant-name").textContent = id;
  $("plant-mesh-error").hidden = true;
  $("plant-mesh").src = plantPath(id, "/mesh.glb");
  $("plant-picture").hidden = true;
  $("plant-picture").src = plantPath(id, "/thumbnail");
  $("link-mesh").href = plantPath(id, "/mesh.glb");
  $("link-record").href = plantPath(id, "/record");
  $("link-json").href = plantPath(id);
  $("link-mesh").download = `${id}.glb`;
  $("link-record").download = `${id}.dmtr`;
  try {
    const [found] = (await ask(plantPath(id))).plants;
    $("plant-name").textContent = `${id} · ${found.species}`;
    $("plant-warnings").replaceChildren(...found.warnings.map((warning) => cell(warning, "li")));
    $("plant-traits").tBodies[0].replaceChildren(...Object.keys(TRAITS).filter((key) => found.traits[key]).map((key) => {
      const { value, unit, sigma } = found.traits[key];
      const [factor, word, digits] = UNITS[unit];
      const row = document.createElement("tr");
      const shown = unit === "1" && Number.isInteger(value) ? String(value) : number(value, factor, digits);
      row.append(cell(TRAITS[key]), cell(shown), cell(sigma == null ? "" : number(sigma, factor, digits)), cell(word));
      return row;
    }));
  } catch (error) {
    $("plant-name").textContent = `${id}: ${error.message}`;
  }
}

$("plant-picture").onload = () => { $("plant-picture").hidden = false; };
$("plant-mesh").addEventListener("error", () => { $("plant-mesh-error").hidden = false; });
$("more").onclick = () => list(next);
addEventListener("hashchange", plant);
plant();
poll();
