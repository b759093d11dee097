"""Client of a running view over the package websockets: receives records, sets a parameter, calls a service."""

import asyncio
import json
import struct
import sys
from collections import Counter

import websockets

TOPICS = [
    "/sensors/front/image",
    "/sensors/front/calibration",
    "/tf",
    "/map/scene",
    "/behaviors/map-localizer/overlay/annotations",
    "decision",
]


async def main(url: str) -> None:
    async with websockets.connect(url, subprotocols=["foxglove.sdk.v1"], max_size=None) as socket:
        assert socket.subprotocol == "foxglove.sdk.v1"
        channels, services, received, decision = {}, {}, Counter(), {}
        speed = mode = None
        phase = "see"
        async with asyncio.timeout(50):
            async for message in socket:
                if isinstance(message, str):
                    answer = json.loads(message)
                    match answer["op"]:
                        case "advertise":
                            channels = {channel["id"]: channel["topic"] for channel in answer["channels"]}
                            wanted = [number for number, topic in channels.items() if topic in TOPICS]
                            wishes = [{"id": number, "channelId": number} for number in wanted]
                            await socket.send(json.dumps({"op": "subscribe", "subscriptions": wishes}))
                        case "advertiseServices":
                            services = {service["name"]: service["id"] for service in answer["services"]}
                        case "parameterValues" if phase == "set":
                            speed, phase = answer["parameters"][0]["value"], "stop"
                            call = struct.pack("<BIII", 2, services["/estop"], 1, 4) + b"json{}"
                            await socket.send(call)
                elif message[0] == 1:
                    number, _ = struct.unpack_from("<IQ", message, 1)
                    topic = channels[number]
                    received[topic] += 1
                    if topic == "decision":
                        decision = json.loads(message[13:])
                        mode = decision["mode_text"]
                    if phase == "see" and all(received[topic] for topic in TOPICS):
                        phase = "set"
                        value = {"name": "map-localizer.speed_mps", "type": "float64", "value": 0.35}
                        request = {"op": "setParameters", "parameters": [value], "id": "1"}
                        await socket.send(json.dumps(request))
                    if phase == "stop" and mode == "emergency stop":
                        break
        print(json.dumps({"received": received, "speed_mps": speed, "mode": mode}))


asyncio.run(main(sys.argv[1]))
