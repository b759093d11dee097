"""Reads a recording with the packages mcap and mcap-protobuf-support and prints what is in it, as JSON.

Usage: mcap_python.py run.mcap
"""

import json
import sys
from collections import Counter

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def main(path):
    counts, images = Counter(), 0
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for schema, channel, message in reader.iter_messages():
            counts[channel.topic] += 1
            if channel.message_encoding == "json":
                value = json.loads(message.data)
                properties = json.loads(schema.data)["properties"]
                unlike = set(value) ^ set(properties)
                assert unlike <= {"header_hex", "items_hex"}, (channel.topic, unlike)
        for schema, _, _, message in reader.iter_decoded_messages(
            topics=[topic for topic in counts if topic.startswith("/")]
        ):
            if schema.name == "foxglove.CompressedImage":
                images += message.data[1:4] == b"PNG"
        in_index = Counter()
        summary = reader.get_summary()
        for channel, count in summary.statistics.channel_message_counts.items():
            in_index[summary.channels[channel].topic] += count
        assert in_index == counts, (in_index, counts)
        metadata = {record.name: record.metadata for record in reader.iter_metadata()}
    json.dump({"counts": counts, "images": images, "metadata": metadata}, sys.stdout)


main(sys.argv[1])
