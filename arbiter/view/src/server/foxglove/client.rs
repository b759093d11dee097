//! One client: its subscriptions, its requests, and the answers.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use axum::extract::ws::{Message, WebSocket};
use tokio::sync::broadcast::error::RecvError;
use tokio::sync::mpsc;
use tokio::time::timeout;

use super::parameters::{self, Parameter};
use super::protocol::{self, Assignment, Binary, ClientChannel, JSON, Level, Request, Subscription};
use super::services::{self, SERVICES};
use super::session::{News, Session};
use super::teleop::{Deflection, Twist};
use super::{Connection, Foxglove};
use crate::server::command::{Answer, Command, Line};
use crate::server::routes::{ANSWER_TIMEOUT, CLIENT_TIMEOUT};

/// Maximum number of malformed messages; then the client is dropped.
const MAX_MALFORMED: u32 = 100;
/// Maximum number of channels on which a client publishes.
const MAX_CLIENT_CHANNELS: usize = 16;
/// Maximum number of answers that wait for the client.
const MAX_ANSWERS: usize = 32;

/// State of one client.
struct Client {
    foxglove: Arc<Foxglove>,
    session: Arc<Session>,
    connection: Connection,
    token: Option<String>,
    subscriptions: Subscriptions,
    publishes: BTreeMap<u32, ClientChannel>,
    parameters: Arc<Vec<Parameter>>,
    followed: BTreeSet<String>,
    answers: mpsc::Sender<Message>,
    malformed: u32,
}

/// Subscriptions of a client; they end when it is dropped.
struct Subscriptions {
    session: Arc<Session>,
    by_channel: BTreeMap<usize, u32>,
}

/// Serves a client until it goes, does not read, sends too much nonsense, or the robot restarts; viewers connect again by
/// themselves.
pub(super) async fn serve(
    mut socket: WebSocket,
    foxglove: Arc<Foxglove>,
    connection: Connection,
    token: Option<String>,
) {
    let mut sessions = foxglove.sessions.subscribe();
    let mut parameters = foxglove.parameters.subscribe();
    // The robot's thread opens the first session a moment after the server has started.
    let session = match timeout(CLIENT_TIMEOUT, sessions.wait_for(|session| session.number > 0)).await {
        Ok(Ok(session)) => Arc::clone(&session),
        _ => return,
    };
    let (mut small, mut large) = session.follow();
    let (answers, mut answered) = mpsc::channel(MAX_ANSWERS);
    let mut client = Client {
        parameters: Arc::clone(&parameters.borrow_and_update()),
        subscriptions: Subscriptions { session: Arc::clone(&session), by_channel: BTreeMap::new() },
        foxglove: Arc::clone(&foxglove),
        session,
        connection,
        token,
        publishes: BTreeMap::new(),
        followed: BTreeSet::new(),
        answers,
        malformed: 0,
    };
    let mut outgoing = client.greeting();
    loop {
        for message in outgoing.drain(..) {
            if !matches!(timeout(CLIENT_TIMEOUT, socket.send(message)).await, Ok(Ok(()))) {
                return;
            }
        }
        tokio::select! {
            news = small.recv() => match news {
                Ok(news) => outgoing.extend(client.subscriptions.message(&news)),
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return,
            },
            news = large.recv() => match news {
                Ok(news) => outgoing.extend(client.subscriptions.message(&news)),
                Err(RecvError::Lagged(_)) => {}
                Err(RecvError::Closed) => return,
            },
            answer = answered.recv() => outgoing.extend(answer),
            changed = parameters.changed() => match changed {
                Ok(()) => outgoing.extend(client.new_parameters(Arc::clone(&parameters.borrow_and_update()))),
                Err(_) => return,
            },
            _ = sessions.changed() => return,
            received = socket.recv() => match received {
                Some(Ok(Message::Text(text))) => outgoing = client.text(&text),
                Some(Ok(Message::Binary(bytes))) => outgoing = client.binary(&bytes),
                Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                _ => return,
            },
        }
        if client.malformed > MAX_MALFORMED {
            return;
        }
    }
}

impl Client {
    fn greeting(&self) -> Vec<Message> {
        let session = &self.session;
        let number = format!("{}-{}", std::process::id(), session.number);
        vec![
            protocol::server_info(&session.robot, &number),
            Message::Text(session.advertisement.as_str().into()),
            Message::Text(services::advertisement().into()),
        ]
    }

    fn text(&mut self, text: &str) -> Vec<Message> {
        let request = match serde_json::from_str(text) {
            Ok(request) => request,
            Err(error) => return self.refuse(&format!("no request: {error}")),
        };
        match request {
            Request::Subscribe { subscriptions } => {
                subscriptions.iter().filter_map(|wish| self.subscriptions.add(wish)).collect()
            }
            Request::Unsubscribe { subscription_ids } => {
                self.subscriptions.remove(&subscription_ids);
                Vec::new()
            }
            Request::Advertise { channels } => {
                channels.into_iter().filter_map(|channel| self.advertise(channel)).collect()
            }
            Request::Unadvertise { channel_ids } => {
                self.publishes.retain(|id, _| !channel_ids.contains(id));
                Vec::new()
            }
            Request::GetParameters { parameter_names: names, id } => {
                let wanted =
                    self.parameters.iter().filter(|known| names.is_empty() || names.contains(&known.name));
                vec![protocol::parameter_values(wanted, id.as_deref())]
            }
            Request::SetParameters { parameters, id } => {
                self.set(parameters, id);
                Vec::new()
            }
            Request::SubscribeParameterUpdates { parameter_names: names } => {
                let known = |name: &String| self.parameters.iter().any(|parameter| parameter.name == *name);
                let known: Vec<String> = names.into_iter().filter(known).collect();
                self.followed.extend(known);
                Vec::new()
            }
            Request::UnsubscribeParameterUpdates { parameter_names: names } => {
                self.followed.retain(|name| !names.contains(name));
                Vec::new()
            }
            // The graph is constant: who has it once needs no more.
            Request::SubscribeConnectionGraph {} => vec![Message::Text(self.session.graph.as_str().into())],
            Request::UnsubscribeConnectionGraph {} => Vec::new(),
        }
    }

    fn binary(&mut self, bytes: &[u8]) -> Vec<Message> {
        match Binary::parse(bytes) {
            Some(Binary::Record { channel, data }) => self.record(channel, data),
            Some(Binary::Call { service, call, encoding, data }) => {
                match self.command_of(service, encoding, data) {
                    Ok(command) => {
                        let pending = self.start(command);
                        let answers = self.answers.clone();
                        tokio::spawn(async move {
                            let answer = pending.await;
                            let answer = answer.as_ref().map(String::as_str).map_err(String::as_str);
                            let _ = answers.send(protocol::service_response(service, call, answer)).await;
                        });
                        Vec::new()
                    }
                    Err(problem) => vec![protocol::service_response(service, call, Err(&problem))],
                }
            }
            None => self.refuse("malformed binary message"),
        }
    }

    fn refuse(&mut self, problem: &str) -> Vec<Message> {
        self.malformed += 1;
        vec![protocol::status(Level::Error, problem)]
    }

    fn command_of(&self, service: u32, encoding: &[u8], data: &[u8]) -> Result<Command, String> {
        let service = SERVICES.get(service as usize).ok_or("there is no such service")?;
        if encoding != JSON.as_bytes() {
            return Err("requests are JSON".to_owned());
        }
        service.command(data)
    }

    /// Starts a command; its answer comes later.
    fn start(&self, command: Command) -> impl Future<Output = Answer> + use<> {
        let shared = &self.foxglove.shared;
        let is_stop = command.line() == Line::Stop;
        let sent = match shared.security.may_command(self.token.as_deref(), self.connection.peer, is_stop) {
            true => shared.commander.send(command),
            false => {
                Err("commands need the token: connect to the address that `yamabico view` printed".to_owned())
            }
        };
        async move {
            match timeout(ANSWER_TIMEOUT, sent?).await {
                Ok(Ok(answer)) => answer,
                _ => Err("no answer".to_owned()),
            }
        }
    }

    /// Sets parameters one after the other; a refusal is reported, and the current values are sent.
    fn set(&self, assignments: Vec<Assignment>, id: Option<String>) {
        let (foxglove, answers) = (Arc::clone(&self.foxglove), self.answers.clone());
        let names: Vec<String> = assignments.iter().map(|assignment| assignment.name.clone()).collect();
        let pending: Vec<_> = assignments
            .into_iter()
            .map(|Assignment { name, value }| match parameters::set(&name, value) {
                Some(command) => Ok(self.start(command)),
                None => Err(format!("there is no parameter `{name}`")),
            })
            .collect();
        let mut changes = foxglove.parameters.subscribe();
        tokio::spawn(async move {
            let mut is_changed = false;
            for pending in pending {
                let answer = match pending {
                    Ok(pending) => pending.await,
                    Err(problem) => Err(problem),
                };
                match answer {
                    Ok(_) => is_changed = true,
                    Err(problem) => {
                        let _ = answers.send(protocol::status(Level::Error, &problem)).await;
                    }
                }
            }
            if is_changed {
                // The new values come back from the robot.
                let _ = timeout(CLIENT_TIMEOUT, changes.changed()).await;
            }
            let all = Arc::clone(&changes.borrow());
            let set = all.iter().filter(|parameter| names.contains(&parameter.name));
            let _ = answers.send(protocol::parameter_values(set, id.as_deref())).await;
        });
    }

    /// Takes in the parameters; returns the changed ones that the client follows.
    fn new_parameters(&mut self, all: Arc<Vec<Parameter>>) -> Option<Message> {
        let before = std::mem::replace(&mut self.parameters, all);
        let is_new =
            |parameter: &&Parameter| self.followed.contains(&parameter.name) && !before.contains(parameter);
        let mut changed = self.parameters.iter().filter(is_new).peekable();
        changed.peek()?;
        Some(protocol::parameter_values(changed, None))
    }

    /// Takes in a channel on which the client will publish; returns a warning if nothing will come of it.
    fn advertise(&mut self, channel: ClientChannel) -> Option<Message> {
        let problem = if channel.encoding != JSON {
            Some(format!("{}: only JSON is understood", channel.topic))
        } else if self.publishes.len() >= MAX_CLIENT_CHANNELS {
            Some("too many channels".to_owned())
        } else if self.session.teleop.is_none() {
            Some(format!(
                "{}: the robot has no teleop behavior, so it cannot be driven from here: add `[behaviors.teleop]` to its task",
                channel.topic
            ))
        } else {
            None
        };
        match problem {
            Some(problem) => Some(protocol::status(Level::Warning, &problem)),
            None => {
                self.publishes.insert(channel.id, channel);
                None
            }
        }
    }

    /// Takes in a message of the client: a velocity for the teleop behavior.
    fn record(&mut self, channel: u32, data: &[u8]) -> Vec<Message> {
        let Some(channel) = self.publishes.get(&channel) else { return self.refuse("unknown channel") };
        let twist: Twist = match serde_json::from_slice(data) {
            Ok(twist) => twist,
            Err(error) => {
                let problem = format!("{}: no velocity as in geometry_msgs/Twist: {error}", channel.topic);
                return self.refuse(&problem);
            }
        };
        let security = &self.foxglove.shared.security;
        if !security.may_command(self.token.as_deref(), self.connection.peer, false) {
            return self
                .refuse("driving needs the token: connect to the address that `yamabico view` printed");
        }
        let teleop = self.session.teleop.as_deref();
        if let Some(shares) = teleop.and_then(|name| twist.shares(name, &self.parameters)) {
            // A full queue drops this deflection; the next one comes soon.
            let _ = self.foxglove.stick.try_send(Deflection { session: self.session.number, shares });
        }
        Vec::new()
    }
}

impl Subscriptions {
    /// Adds a subscription; returns what the client needs at once: a lasting record, or an error.
    fn add(&mut self, wish: &Subscription) -> Option<Message> {
        if wish.channel_id >= self.session.channels.len() {
            return Some(protocol::status(Level::Error, &format!("there is no channel {}", wish.channel_id)));
        }
        if self.by_channel.contains_key(&wish.channel_id) || self.by_channel.values().any(|id| *id == wish.id)
        {
            return Some(protocol::status(
                Level::Warning,
                &format!("channel {} is subscribed already", wish.channel_id),
            ));
        }
        self.by_channel.insert(wish.channel_id, wish.id);
        let lasting = self.session.subscribe(wish.channel_id)?;
        self.message(&lasting)
    }

    fn remove(&mut self, ids: &[u32]) {
        self.by_channel.retain(|channel, id| {
            let is_kept = !ids.contains(id);
            if !is_kept {
                self.session.unsubscribe(*channel);
            }
            is_kept
        });
    }

    /// Message for the client; `None` if it has not subscribed to the channel.
    fn message(&self, news: &News) -> Option<Message> {
        match news {
            News::Record { channel, time, data } => {
                Some(protocol::record(*self.by_channel.get(channel)?, *time, data))
            }
            News::Time(time) => Some(protocol::time(*time)),
        }
    }
}

impl Drop for Subscriptions {
    fn drop(&mut self) {
        self.by_channel.keys().for_each(|channel| self.session.unsubscribe(*channel));
    }
}
