# Stands in for the external program of a driver: describes itself.
cat <<'END'
{
  "protocol": 2,
  "name": "bench-lidar",
  "summary": "A lidar on a bench.",
  "parameters": { "type": "object", "properties": { "port": { "type": "string" } }, "required": ["port"] },
  "sensors": [{
    "kind": "lidar",
    "summary": "Ranges all around.",
    "message": "yamabico.RangeScanHeader.v1",
    "parameters": { "type": "object", "properties": { "beams": { "type": "integer", "minimum": 1 } } }
  }],
  "drives": [{
    "kind": "tracks",
    "summary": "Two tracks.",
    "axes": "linear+angular",
    "parameters": { "type": "object", "properties": { "gear": { "type": "integer" } } }
  }]
}
END
