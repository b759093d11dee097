//! Every message type by name, for whoever meets messages without knowing their Rust type: recorder, slots, tools.

use super::*;

/// What can be known of a message type without naming it in Rust.
#[derive(Clone, Copy)]
pub struct MessageType {
    /// Versioned name, such as `yamabico.Odometry.v1`.
    pub name: &'static str,
    /// How a channel of it treats a slow reader.
    pub channel: Channel,
    /// Bytes of the header.
    pub header_size: usize,
    /// Alignment of the header, bytes.
    pub header_align: usize,
    /// Bytes of one item.
    pub item_size: usize,
    /// The fields of the header.
    pub header: Layout,
    /// The fields of an item; [`Layout::U8`] for pixels, words, and messages without a list.
    pub item: Layout,
    /// The stamps (capture, evidence) of a header given as bytes; zero where it has the wrong size.
    pub stamps: fn(header: &[u8]) -> (Time, Time),
    /// The sequence number of a header given as bytes; zero where it has the wrong size.
    pub sequence: fn(header: &[u8]) -> u64,
    /// Header and items as JSON, a text under `text`; null where the sizes are wrong. A frame's pixels are left out.
    pub to_json: fn(header: &[u8], items: &[u8]) -> serde_json::Value,
}

impl MessageType {
    /// That of `M`.
    pub const fn of<M: Message>() -> MessageType {
        MessageType {
            name: M::NAME,
            channel: M::CHANNEL,
            header_size: size_of::<M>(),
            header_align: align_of::<M>(),
            item_size: size_of::<M::Item>(),
            header: M::LAYOUT,
            item: <M::Item as Laid>::LAYOUT,
            stamps: stamps::<M>,
            sequence: sequence::<M>,
            to_json: to_json::<M>,
        }
    }

    /// The type of this name; `None` where no such type travels.
    pub fn find(name: &str) -> Option<&'static MessageType> {
        ALL.iter().find(|message| message.name == name)
    }

    /// Why the type `name` is not found, in words: the version that this program knows instead, where it knows one.
    pub fn unknown(name: &str) -> String {
        let family =
            |name: &str| name.rsplit_once(".v").map_or_else(|| name.to_owned(), |(f, _)| f.to_owned());
        match ALL.iter().find(|message| family(message.name) == family(name)) {
            Some(known) => format!("`{name}` is another version than the `{}` of this program", known.name),
            None => format!("this program knows no message `{name}`"),
        }
    }
}

impl PartialEq for MessageType {
    fn eq(&self, other: &Self) -> bool {
        self.name == other.name
    }
}

impl Eq for MessageType {}

impl std::fmt::Debug for MessageType {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// Every type that travels.
pub static ALL: &[MessageType] = &[
    MessageType::of::<FrameHeader>(),
    MessageType::of::<RangeScanHeader>(),
    MessageType::of::<Odometry>(),
    MessageType::of::<Imu>(),
    MessageType::of::<Bumper>(),
    MessageType::of::<Clock>(),
    MessageType::of::<Turn>(),
    MessageType::of::<Truth>(),
    MessageType::of::<Goal>(),
    MessageType::of::<PathHeader>(),
    MessageType::of::<Pose>(),
    MessageType::of::<ObstaclesHeader>(),
    MessageType::of::<FreeSpaceHeader>(),
    MessageType::of::<LandmarksHeader>(),
    MessageType::of::<Intersection>(),
    MessageType::of::<Proposal>(),
    MessageType::of::<Command>(),
    MessageType::of::<DecisionHeader>(),
    MessageType::of::<Heartbeat>(),
    MessageType::of::<FailureHeader>(),
    MessageType::of::<CallsHeader>(),
    MessageType::of::<MemoryHeader>(),
    MessageType::of::<WallsHeader>(),
    MessageType::of::<ProcessesHeader>(),
    MessageType::of::<RosterHeader>(),
    MessageType::of::<Control>(),
    MessageType::of::<RetuneHeader>(),
    MessageType::of::<RetunedHeader>(),
    MessageType::of::<Stick>(),
];

fn stamps<M: Message>(header: &[u8]) -> (Time, Time) {
    match bytemuck::try_pod_read_unaligned::<M>(header) {
        Ok(header) => (header.stamp(), header.evidence()),
        Err(_) => (Time::ZERO, Time::ZERO),
    }
}

fn sequence<M: Message>(header: &[u8]) -> u64 {
    bytemuck::try_pod_read_unaligned::<M>(header).map_or(0, |header| header.sequence())
}

fn to_json<M: Message>(header: &[u8], items: &[u8]) -> serde_json::Value {
    let Ok(header) = bytemuck::try_pod_read_unaligned::<M>(header) else { return serde_json::Value::Null };
    let mut json = serde_json::to_value(header).unwrap_or_default();
    let size = size_of::<M::Item>();
    if size > 1
        && let Some(object) = json.as_object_mut()
    {
        let items: Vec<M::Item> = items.chunks_exact(size).map(bytemuck::pod_read_unaligned).collect();
        object.insert("items".into(), serde_json::to_value(items).unwrap_or_default());
    }
    if M::IS_WORDED
        && let Some(object) = json.as_object_mut()
    {
        let text = String::from_utf8_lossy(items);
        object.insert("text".into(), text.trim_end_matches('\0').into());
    }
    json
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_versioned_and_unique() {
        for (i, message) in ALL.iter().enumerate() {
            let (family, version) = message.name.rsplit_once(".v").unwrap();
            assert!(family.starts_with("yamabico.") && version.parse::<u32>().is_ok(), "{}", message.name);
            assert!(ALL[..i].iter().all(|other| other.name != message.name));
            assert_eq!(MessageType::find(message.name), Some(message));
        }
    }

    /// A layout that changes needs a new version in its header's name.
    #[test]
    fn layouts_belong_to_their_versions() {
        let mut layouts = String::new();
        for message in ALL {
            let header = vec![0; message.header_size];
            let items = vec![0; if message.item_size > 1 { message.item_size } else { 0 }];
            let json = (message.to_json)(&header, &items);
            let keys = |json: &serde_json::Value| {
                json.as_object().map_or_else(String::new, |o| o.keys().cloned().collect::<Vec<_>>().join(" "))
            };
            layouts += &format!("{}: {} + {}\n", message.name, message.header_size, message.item_size);
            layouts += &format!("  {}\n", keys(&json));
            if let Some(item) = json.get("items").and_then(|items| items.get(0)) {
                layouts += &format!("  items: {}\n", keys(item));
            }
        }
        insta::assert_snapshot!(layouts);
    }

    #[test]
    fn a_list_becomes_json_with_its_items() {
        let scan = RangeScanHeader { stamp_ns: 7, max_m: 3.0, ..Default::default() };
        let beams =
            [Beam { range_m: 0.4, ..Default::default() }, Beam { flags: NO_ECHO, ..Default::default() }];
        let json = (MessageType::of::<RangeScanHeader>().to_json)(
            bytemuck::bytes_of(&scan),
            bytemuck::cast_slice(&beams),
        );
        assert_eq!(json["stamp_ns"], 7);
        assert_eq!(json["items"][0]["range_m"], 0.4);
        assert_eq!(json["items"].as_array().unwrap().len(), 2);
    }

    #[test]
    fn of_another_version_both_are_named() {
        let told = MessageType::unknown("yamabico.Odometry.v9");
        assert!(told.contains("yamabico.Odometry.v9") && told.contains("yamabico.Odometry.v1"), "{told}");
        assert!(MessageType::unknown("yamabico.Smell.v1").contains("no message"));
    }

    #[test]
    fn wrong_sizes_are_null_and_not_a_panic() {
        let odometry = MessageType::of::<Odometry>();
        assert!((odometry.to_json)(&[1, 2, 3], &[]).is_null());
        assert_eq!((odometry.stamps)(&[]), (Time::ZERO, Time::ZERO));
        assert_eq!((odometry.sequence)(&[1]), 0);
    }

    #[test]
    fn a_sequence_is_read_from_bytes() {
        let clock = Clock { step: 9, ..Default::default() };
        assert_eq!((MessageType::of::<Clock>().sequence)(bytemuck::bytes_of(&clock)), 9);
    }
}
