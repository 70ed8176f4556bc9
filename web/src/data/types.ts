/** What the service answers. Written by `make page-types` from its OpenAPI document: don't edit it here. */

/** Who acknowledges an alert is known; a note is not needed. */
export interface Acknowledgement {
  note?: string | null;
}

/** Something a person should know. */
export interface Alert {
  id: string;
  rule: string;
  kind: string;
  meaning: string;
  silo: string;
  state: "firing" | "resolved";
  /** When the value went beyond the level. */
  since: string;
  fired: string;
  resolved: string | null;
  value: number | null;
  threshold: number | null;
  unit: string;
  acknowledged: string | null;
  acknowledged_by: string | null;
  note: string | null;
  version: number;
}

/** The newest frame's outcome, where it differs from the newest answer. */
export interface Attempt {
  time: string;
  status: "ok" | "refused";
  reason: string | null;
  message: string | null;
  frame: string | null;
  quality: Remark[];
}

/** Who did what. */
export interface AuditLine {
  id: number;
  time: string;
  who: string;
  action: string;
  subject: string | null;
  detail: Record<string, unknown> | null;
  address: string | null;
}

/** Readings of a stretch of time. */
export interface Bucket {
  /** Beginning of the stretch. */
  time: string;
  end: string;
  count: number;
  volume_m3: number | null;
  volume_std_m3: number | null;
  volume_min_m3: number | null;
  volume_max_m3: number | null;
  fill_fraction: number | null;
  mass_kg: number | null;
}

/** A calibration of a camera in its silo. */
export interface Calibration {
  id: string;
  silo: string;
  camera: string;
  sha256: string;
  origin: "site" | "uploaded" | "gathered" | "moved";
  state: "confirmed" | "proposed" | "rejected";
  frames: number;
  created: string;
  valid_from: string;
  valid_to: string | null;
  confirmed_by: string | null;
}

/** A camera and what is known of it. */
export interface Camera {
  id: string;
  silo: string;
  sensor: string | null;
  depth_unit: number | null;
  expected_s: number | null;
  has_intrinsics: boolean;
  version: number;
  state: CameraState;
  /** Null where the camera sends its frames. */
  live: Live | null;
}

/** What is to change of a camera; what is left out stays. */
export interface CameraChange {
  silo?: string | null;
  /** Text of a camera file. */
  intrinsics?: string | null;
  /** Name of a sensor profile. */
  sensor?: string | null;
  depth_unit?: number | null;
  expected_s?: number | null;
}

/** A camera as it is heard of. */
export interface CameraState {
  id: string;
  last_frame: string | null;
  last_captured: string | null;
  last_received: string | null;
  last_state: string | null;
  /** Since when its view contradicts its calibration. */
  moved_since: string | null;
  /** A calibration that waits to be confirmed. */
  proposed_calibration: string | null;
}

/** One line of the log of changes; the stream of events carries the same. */
export interface Change {
  id: number;
  kind: string;
  subject: string;
  silo: string | null;
  time: string;
}

/** An alert on its way to a channel. */
export interface Delivery {
  id: number;
  channel: string;
  /** The same for every attempt. */
  key: string;
  alert: string | null;
  state: "pending" | "failed" | "delivered";
  created: string;
  attempts: number;
  /** When it is tried again. */
  next: string | null;
  delivered: string | null;
  /** Of the last attempt. */
  error: string | null;
}

/** That somebody at a box has seen an alert. */
export interface EdgeAcknowledgement {
  silo: string;
  kind: string;
  who: string;
  note?: string | null;
}

/** A calibration that a box made. */
export interface EdgeCalibration {
  silo: string;
  camera: string;
  origin: string;
  state: "confirmed" | "proposed" | "rejected";
  frames: number;
  valid_from: number;
  valid_to: number | null;
  confirmed_by: string | null;
  document: string;
}

/** A reading with the frame it is of. */
export interface EdgeReading {
  camera: string;
  sha256: string;
  format: string;
  bytes: number;
  time: number;
  clock: "good" | "corrected" | "suspect";
  /** Whether its time is by the clock that `sent` is by. */
  current: boolean;
  run: number;
  run_version: string;
  run_config: string;
  calibration: string | null;
  values: EdgeValues;
  surface: string | null;
}

/** What a box has measured. */
export interface EdgeReadings {
  box: string;
  sent: number;
  readings: EdgeReading[];
}

/** What a box goes by, as rows of the store. */
export interface EdgeSettings {
  /** Number of the last change that is in it. */
  cursor: number;
  settings: Record<string, (Record<string, unknown>)[]>;
}

/** All of it is safe; how much was new. */
export interface EdgeTaken {
  new: number;
}

/** A reading's columns. */
export interface EdgeValues {
  status: "ok" | "refused";
  reason: string | null;
  message: string | null;
  volume: number | null;
  volume_std: number | null;
  own_std: number | null;
  ullage: number | null;
  ullage_std: number | null;
  fill: number | null;
  capacity: number | null;
  mass: number | null;
  mass_std: number | null;
  density: number | null;
  level: number | null;
  level_min: number | null;
  level_max: number | null;
  level_axis: number | null;
  level_std: number | null;
  datum: string | null;
  distance: number | null;
  distance_min: number | null;
  distance_max: number | null;
  coverage: number | null;
  quality: Remark[];
}

/** A refill or a withdrawal. */
export interface Event {
  id: string;
  silo: string;
  kind: "refill" | "withdrawal";
  start: string;
  end: string;
  volume_m3: number;
  volume_std_m3: number;
  mass_kg: number | null;
}

/** Daily use over the last four weeks, and when the silo will be empty if it goes on so. */
export interface Forecast {
  silo: string;
  /** False where there is no day of history yet, or nothing was withdrawn. */
  known: boolean;
  computed: string | null;
  daily_m3: number | null;
  daily_std_m3: number | null;
  day_to_day_std_m3: number | null;
  daily_kg: number | null;
  empty_by: string | null;
  /** Beginning of the 95 % band; the conservative date. */
  earliest: string | null;
  latest: string | null;
}

/** A frame and what became of it. */
export interface Frame {
  id: string;
  camera: string;
  silo: string;
  sha256: string;
  /** gathering: waits for its camera's calibration. */
  state: "queued" | "measuring" | "measured" | "gathering" | "failed";
  captured: string;
  received: string;
  clock: "good" | "corrected" | "suspect";
  format: string;
  bytes: number;
  /** Whether the bytes are still there. */
  kept: boolean;
  attempts: number;
  error: string | null;
  reading: Reading | null;
}

/** A frame that is on the disk and in the database. */
export interface FrameTaken {
  frame: string;
}

/** A role on a place and all that lies in it; null is everywhere. */
export interface Grant {
  id: number;
  user: string;
  place: string | null;
  role: "percent" | "viewer" | "operator" | "admin";
}

/** Whether the service is alive, or ready. */
export interface Health {
  status: "ok" | "not-ready";
  version: string;
  detail: Record<string, string | number | boolean | null>;
}

/** A user and the link where the password is set, told once. */
export interface Invitation {
  user: User;
  link: string;
}

/** Heights of the surface over the datum, m. */
export interface Level {
  mean: number | null;
  min: number | null;
  max: number | null;
  at_axis: number | null;
  /** Standard deviation of the mean. */
  std: number | null;
}

/** A camera that the service drives itself. */
export interface Live {
  /** realsense, orbbec, folder, inbox, command. */
  source: string;
  state: "starting" | "ok" | "failing";
  /** Why it gives no frames, in English. */
  problem: string | null;
  since: string;
}

/** A role to be given; it takes the place of one on the same place. */
export interface NewGrant {
  user: string;
  place?: string | null;
  role: "percent" | "viewer" | "operator" | "admin";
}

/** A ticket to be noted. */
export interface NewTicket {
  time: string;
  mass_kg: number;
  number?: string | null;
  note?: string | null;
}

/** A token to be made. */
export interface NewToken {
  role: "camera" | "read" | "metrics" | "edge" | "admin";
  camera?: string | null;
  name?: string | null;
}

/** A user to be made, with a first role. */
export interface NewUser {
  name: string;
  role?: "percent" | "viewer" | "operator" | "admin";
  place?: string | null;
}

/** A silo's newest answer with its age. Stale numbers are given, and said to be stale. */
export interface Now {
  silo: string;
  /** ok; refused: the newest frame has no answer; stale: older than `stale_after_s`; no-data: never a reading; no-calibration: frames wait for one. */
  state: "ok" | "refused" | "stale" | "no-data" | "no-calibration";
  time: string | null;
  age_s: number | null;
  stale: boolean;
  stale_after_s: number;
  clock: "good" | "corrected" | "suspect" | null;
  status: "ok" | "refused" | null;
  volume_m3: number | null;
  volume_std_m3: number | null;
  fill_fraction: number | null;
  fill_std: number | null;
  free_m3: number | null;
  capacity_m3: number | null;
  ullage_m3: number | null;
  ullage_std_m3: number | null;
  mass_kg: number | null;
  mass_std_kg: number | null;
  level_m: Level | null;
  height_datum: string | null;
  coverage: number | null;
  quality: Remark[];
  reading: number | null;
  frame: string | null;
  calibration: string | null;
  last_attempt: Attempt | null;
  cameras: CameraState[];
}

export interface PageAlert {
  items: Alert[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageAuditLine {
  items: AuditLine[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageCalibration {
  items: Calibration[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageCamera {
  items: Camera[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageChange {
  items: Change[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageDelivery {
  items: Delivery[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageEvent {
  items: Event[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageFrame {
  items: Frame[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageGrant {
  items: Grant[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PagePlace {
  items: Place[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageProduct {
  items: Product[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageReading {
  items: Reading[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageRule {
  items: Rule[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageRun {
  items: Run[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageSilo {
  items: Silo[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageTicket {
  items: Ticket[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageToken {
  items: Token[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageUser {
  items: User[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

export interface PageUsualProduct {
  items: UsualProduct[];
  /** Cursor of what follows; null at the end. Give it as `after`. */
  next: string | null;
}

/** A mill, customer, farm, barn. */
export interface Place {
  id: string;
  parent: string | null;
  kind: string;
  name: string;
  zone: string | null;
  version: number;
}

/** What is to change of a place; what is left out stays. */
export interface PlaceChange {
  parent?: string | null;
  kind?: "mill" | "customer" | "farm" | "barn" | "site" | null;
  name?: string | null;
  zone?: string | null;
}

/** How a camera hangs in its silo, by its newest frame alone: numbers of `siloscope.locate`, radians and metres. */
export interface Pose {
  camera: string;
  silo: string;
  /** null where no frame has come yet. */
  frame: string | null;
  time: string | null;
  status: "ok" | "refused" | null;
  reason: string | null;
  message: string | null;
  r_x: number | null;
  r_y: number | null;
  t_x: number | null;
  t_y: number | null;
  std: PoseStd | null;
}

/** Standard deviations of a pose. */
export interface PoseStd {
  r_x: number | null;
  r_y: number | null;
  t_x: number | null;
  t_y: number | null;
}

/** RFC 9457 problem details. */
export interface Problem {
  type: string;
  title: string;
  status: number;
  detail: string;
  slug: string;
}

/** What a silo may hold. */
export interface Product {
  id: string;
  name: string;
  density_kg_m3: number;
  density_std_kg_m3: number;
  version: number;
}

/** What is to change of a product. */
export interface ProductChange {
  name?: string | null;
  density_kg_m3?: number | null;
  density_std_kg_m3?: number | null;
}

/** What one frame says about a silo's content. A number that is not known is null, never made up. */
export interface Reading {
  id: number;
  silo: string;
  /** When the frame was taken. */
  time: string;
  /** How far `time` can be trusted; suspect times are kept out of trends. */
  clock: "good" | "corrected" | "suspect";
  status: "ok" | "refused";
  reason: string | null;
  message: string | null;
  volume_m3: number | null;
  volume_std_m3: number | null;
  fill_fraction: number | null;
  fill_std: number | null;
  free_m3: number | null;
  capacity_m3: number | null;
  ullage_m3: number | null;
  ullage_std_m3: number | null;
  mass_kg: number | null;
  mass_std_kg: number | null;
  level_m: Level | null;
  /** Where heights are 0: cone-vertex, floor or lowest-seen. */
  height_datum: string | null;
  /** Fraction of the surface that is really seen. */
  coverage: number | null;
  quality: Remark[];
  frame: string | null;
  camera: string | null;
  calibration: string | null;
  run: number | null;
  superseded: boolean;
}

/** A new run over frames that are still there; their old readings stay. */
export interface Recomputed {
  run: number;
  frames: number;
}

/** A remark on a reading, from the table in docs/reasons.md. */
export interface Remark {
  code: string;
  message: string;
  severity: "note" | "warning" | "refusal";
  advice: string | null;
}

/** A role on a place; null is everywhere. */
export interface RoleAt {
  place: string | null;
  role: "percent" | "viewer" | "operator" | "admin";
}

/** When an alert fires, and for which silos: the one that names a silo wins over a place's, and that over all. */
export interface Rule {
  id: string;
  kind: string;
  meaning: string;
  unit: string;
  silo: string | null;
  place: string | null;
  /** Beyond it the rule is active; null for no-data is the silo's own limit. */
  level: number | null;
  /** Back beyond it the alert ends. */
  clear: number | null;
  delay_s: number;
  channels: string[];
  enabled: boolean;
  version: number;
}

/** What is to change of a rule. */
export interface RuleChange {
  kind?: "low" | "critical" | "overfill" | "sudden-drop" | "consumption" | "flatline" | "no-data" | "dirty-lens" | "camera-moved" | "bridging" | null;
  silo?: string | null;
  place?: string | null;
  level?: number | null;
  clear?: number | null;
  delay_s?: number | null;
  channels?: string[] | null;
  enabled?: boolean | null;
}

/** What measured readings of a silo; the readings of an older run stay beside those that replaced them. */
export interface Run {
  id: number;
  /** Of siloscope. */
  version: string;
  /** Hash of the settings; of an imported run its id. */
  config: string;
  /** measured, recomputed, fleet (imported), edge, simulated. */
  origin: string;
  created: string;
  note: string | null;
  /** Readings that count. */
  current: number;
  /** Readings that a later run replaced. */
  replaced: number;
  first: string;
  last: string;
}

/** Who is signed in. */
export interface Session {
  person: string;
  kind: "user" | "token" | "local";
  role: "percent" | "viewer" | "operator" | "admin" | null;
  grants: RoleAt[];
}

/** A user's name and password. */
export interface SignIn {
  name: string;
  password: string;
}

/** A silo with what a card shows. */
export interface Silo {
  id: string;
  name: string;
  place: string | null;
  product: string | null;
  banner: string | null;
  /** Lengths as they were told. */
  vessel: Record<string, string | number | null>;
  /** What the silo is drawn from; null for who sees percent only. */
  drawn: Vessel | null;
  stale_after_s: number;
  modbus_unit: number | null;
  serial: number | null;
  zone: string;
  version: number;
  /** What who asks may do here: percent, viewer, operator or admin. */
  role: string;
  now: Now;
  forecast: Forecast;
  alerts_firing: number;
  alerts_unacknowledged: number;
}

/** What is to change of a silo; what is left out stays. */
export interface SiloChange {
  name?: string | null;
  place?: string | null;
  product?: string | null;
  /** A notice on the silo, such as out of service. */
  banner?: string | null;
  vessel?: VesselChange | null;
  stale_after_s?: number | null;
  modbus_unit?: number | null;
  serial?: number | null;
}

/** The whole installation, and who asks. */
export interface Site {
  name: string | null;
  zone: string;
  box: string;
  version: string;
  demo: boolean;
  /** The server's time. */
  time: string;
  person: string;
  kind: "user" | "token" | "local";
  role: string | null;
  /** Whether no user exists yet. */
  needs_user: boolean;
  disk_free_bytes: number;
  disk_total_bytes: number;
  /** Whether no frames are taken for want of room. */
  disk_short: boolean;
  frames_queued: number;
  frames_failed: number;
  /** Number of the last change; where the stream of events begins. */
  last_change: number;
}

/** A surface over the cross-section. Rows run along y, columns along x of the silo frame, from minus to plus. */
export interface Surface {
  silo: string;
  time: string;
  reading: number;
  /** Cells along a side. */
  side: number;
  half_width_m: number;
  radius_m: number | null;
  height_datum: string | null;
  /** Heights over the datum; null outside the silo. */
  heights_m: ((number | null)[])[];
  std_m: ((number | null)[])[];
  /** Cells that were really seen. */
  seen: boolean[][];
  vessel: Vessel;
}

/** A weighbridge ticket: what was delivered (positive) or taken away (negative). */
export interface Ticket {
  id: string;
  silo: string;
  time: string;
  mass_kg: number;
  number: string | null;
  note: string | null;
  created: string;
  created_by: string;
}

/** A token without its secret. */
export interface Token {
  id: string;
  role: "camera" | "read" | "metrics" | "edge" | "admin";
  camera: string | null;
  name: string | null;
  created: string;
  revoked: string | null;
}

/** A token with its secret, told once. */
export interface TokenTold {
  token: Token;
  secret: string;
}

/** Means over equal stretches; a stretch without a reading is left out and is a gap. */
export interface Trend {
  silo: string;
  since: string;
  until: string;
  bucket_s: number;
  items: Bucket[];
}

/** A user. */
export interface User {
  id: string;
  name: string;
  created: string;
  disabled: string | null;
  grants: Grant[];
}

/** A product of the built-in table, to begin from. */
export interface UsualProduct {
  name: string;
  density_kg_m3: number;
  density_std_kg_m3: number;
}

/** What the vessel is drawn from; null where not known. z is down from the camera's height. */
export interface Vessel {
  radius_m: number | null;
  top_z_m: number | null;
  cylinder_bottom_z_m: number | null;
  bottom_z_m: number | null;
  bottom: string | null;
  /** z of height 0. */
  datum_z_m: number | null;
}

/** Inner lengths of a silo, m. */
export interface VesselChange {
  diameter: number | null;
  cylinder: number | null;
  cone: number | null;
  bottom: "cone" | "flat" | "unknown" | null;
  top: number | null;
  outlet_diameter: number | null;
  outlet_length: number | null;
}

/** A one-time link's secret and what it is used for. */
export interface Welcome {
  link: string;
  /** Of the first user. */
  name?: string | null;
  password: string;
}
