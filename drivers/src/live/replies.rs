//! Replies to requests, kept so that a repeated request gets the same reply and is not carried out again.

use super::call::RequestId;
use lcmtypes::RequestReply;
use std::collections::VecDeque;

/// Requests that are remembered. A client repeats a request for a few seconds at most.
const CAPACITY: usize = 1024;

/// State of a request that has been received before.
#[derive(Clone, Debug, PartialEq)]
pub enum Known {
    /// It is being carried out; its reply will follow.
    Pending,
    /// It was answered with this reply.
    Answered(RequestReply),
}

/// The requests of a run and their replies.
#[derive(Debug, Default)]
pub struct Replies {
    /// Oldest first. `None`: pending.
    requests: VecDeque<(RequestId, Option<RequestReply>)>,
}

impl Replies {
    /// Notes a request as pending; returns its state if it has been received before.
    pub fn open(&mut self, id: RequestId) -> Option<Known> {
        if let Some((_, reply)) = self.requests.iter().find(|(known, _)| *known == id) {
            return Some(reply.clone().map_or(Known::Pending, Known::Answered));
        }
        if self.requests.len() >= CAPACITY {
            // The ring of calls and the queue of parameter requests bound the pending ones far below the capacity.
            let oldest_answered = self.requests.iter().position(|(_, reply)| reply.is_some());
            self.requests.remove(oldest_answered.unwrap_or(0));
        }
        self.requests.push_back((id, None));
        None
    }

    /// Keeps the reply to a request.
    pub fn answer(&mut self, reply: &RequestReply) {
        let id = RequestId { kind: reply.kind, sender_id: reply.sender_id, request_id: reply.request_id };
        if let Some((_, slot)) = self.requests.iter_mut().find(|(known, _)| *known == id) {
            *slot = Some(reply.clone());
        }
    }

    /// Requests without a reply, oldest first.
    pub fn pending(&self) -> Vec<RequestId> {
        self.requests.iter().filter(|(_, reply)| reply.is_none()).map(|(id, _)| *id).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_repeated_request_gets_the_same_reply() {
        let id = |sender_id, request_id| RequestId { kind: 0, sender_id, request_id };
        let mut replies = Replies::default();
        assert_eq!(replies.open(id(1, 7)), None);
        assert_eq!(replies.open(id(2, 7)), None, "another sender with the same number");
        assert_eq!(replies.open(RequestId { kind: 1, ..id(2, 7) }), None, "another kind with the same number");
        replies.answer(&RequestReply { kind: 1, sender_id: 2, request_id: 7, ..RequestReply::default() });
        assert_eq!(replies.open(id(1, 7)), Some(Known::Pending));
        let reply = RequestReply { sender_id: 1, request_id: 7, tick: 40, ..RequestReply::default() };
        replies.answer(&reply);
        assert_eq!(replies.open(id(1, 7)), Some(Known::Answered(reply)));
        assert_eq!(replies.pending(), [id(2, 7)]);
    }

    #[test]
    fn the_oldest_answered_requests_are_forgotten_and_pending_ones_kept() {
        let id = |request_id| RequestId { kind: 0, sender_id: 1, request_id };
        let mut replies = Replies::default();
        assert_eq!(replies.open(id(0)), None);
        for request_id in 1..=1024 {
            assert_eq!(replies.open(id(request_id)), None);
            replies.answer(&RequestReply { sender_id: 1, request_id, ..RequestReply::default() });
        }
        assert_eq!(replies.pending(), [id(0)]);
        assert_eq!(replies.open(id(0)), Some(Known::Pending));
        assert!(matches!(replies.open(id(2)), Some(Known::Answered(_))));
        assert_eq!(replies.open(id(1)), None, "the oldest answered one is forgotten");
    }
}
