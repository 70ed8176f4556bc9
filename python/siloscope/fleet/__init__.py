"""Many machines over many stored frames: seal, plan, run, commit, compare, publish.

Frames are sealed in shards of a silo's camera (`pack`); a plan names the shards and everything that decides the answers
(`plan`); a task is a pure function of plan and shard (`stages`) whose result counts once it is committed (`commit`).
An engine (`engines`) only decides where tasks run, so every engine gives the same bytes.
"""
