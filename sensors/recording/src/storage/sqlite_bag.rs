//! Messages of a rosbag2 file in SQLite: the tables `topics` and `messages`.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::sqlite::{Database, Row, Rows, Table, Value};
use super::{StoredMessage, Topic};

/// Maximum number of topics.
const MAX_TOPICS: usize = 10_000;

/// Returns the messages of a file in the order in which they were written.
///
/// # Errors
/// The file cannot be read, or is none of rosbag2.
pub fn messages(
    path: &Path,
) -> Result<impl Iterator<Item = Result<StoredMessage, String>> + Send + use<>, String> {
    let database = Database::open(path).map_err(|error| error.to_string())?;
    let table = |name: &str| {
        let table = database.table(name).map_err(|error| error.to_string())?;
        table.ok_or_else(|| format!("has no table `{name}`: it is not a recording of rosbag2"))
    };
    let (topics, messages) = (topics(&database, &table("topics")?)?, table("messages")?);
    let columns = MessageColumns::find(&messages).ok_or("its table `messages` is not that of rosbag2")?;
    let mut number = 0_u64;
    let mut rows = Rows::new(database, &messages);
    Ok(std::iter::from_fn(move || {
        number += 1;
        Some(match rows.next()? {
            Ok(row) => columns.message(row, &topics).ok_or_else(|| format!("message {number} is malformed")),
            Err(error) => Err(error.to_string()),
        })
    }))
}

fn topics(database: &Database, table: &Table) -> Result<BTreeMap<i64, Arc<Topic>>, String> {
    let place = |name: &str| table.columns.iter().position(|column| column == name);
    let columns = (place("name"), place("type"), place("serialization_format"));
    let (Some(name), Some(kind), Some(encoding)) = columns else {
        return Err("its table `topics` is not that of rosbag2".to_owned());
    };
    let mut topics = BTreeMap::new();
    for row in database.rows(table) {
        let row = row.map_err(|error| error.to_string())?;
        let text = |place: usize| row.values.get(place).and_then(Value::text).map(str::to_owned);
        let (Some(name), Some(message_type), Some(encoding)) = (text(name), text(kind), text(encoding))
        else {
            return Err(format!("topic {} is malformed", row.number));
        };
        topics.insert(row.number, Arc::new(Topic { name, message_type, encoding }));
        if topics.len() > MAX_TOPICS {
            return Err(format!("has more than {MAX_TOPICS} topics"));
        }
    }
    Ok(topics)
}

/// Places of the columns of the table `messages`.
#[derive(Clone, Copy)]
struct MessageColumns {
    topic: usize,
    time: usize,
    data: usize,
}

impl MessageColumns {
    fn find(table: &Table) -> Option<MessageColumns> {
        let place = |name: &str| table.columns.iter().position(|column| column == name);
        Some(MessageColumns { topic: place("topic_id")?, time: place("timestamp")?, data: place("data")? })
    }

    fn message(self, mut row: Row, topics: &BTreeMap<i64, Arc<Topic>>) -> Option<StoredMessage> {
        let topic = Arc::clone(topics.get(&row.values.get(self.topic)?.integer()?)?);
        let log_time = u64::try_from(row.values.get(self.time)?.integer()?).ok()?;
        let Value::Bytes(data) = std::mem::replace(row.values.get_mut(self.data)?, Value::Null) else {
            return None;
        };
        Some(StoredMessage { topic, log_time, data })
    }
}
