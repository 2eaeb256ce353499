//! URL of an LCM network.

use crate::Error;
use std::net::Ipv4Addr;
use std::str::FromStr;

/// An LCM network over UDP multicast.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Url {
    /// Multicast group.
    pub group: Ipv4Addr,
    /// UDP port.
    pub port: u16,
    /// Time to live: number of routers that a message may pass; 0 stays on this machine.
    pub ttl: u8,
    /// Requested size of the kernel's receive buffer, bytes.
    pub recv_buf_size: Option<usize>,
}

impl Default for Url {
    /// LCM's own default, `udpm://239.255.76.67:7667?ttl=0`.
    fn default() -> Self {
        Url { group: Ipv4Addr::new(239, 255, 76, 67), port: 7667, ttl: 0, recv_buf_size: None }
    }
}

impl Url {
    /// `given`, else the environment variable `LCM_DEFAULT_URL`, else LCM's default.
    ///
    /// # Errors
    /// [`Error::LcmUrl`] if it is not a valid `udpm://` URL.
    pub fn choose(given: Option<&str>) -> Result<Self, Error> {
        let from_environment = std::env::var("LCM_DEFAULT_URL").ok().filter(|url| !url.is_empty());
        match given.map(str::to_owned).or(from_environment) {
            Some(url) => url.parse(),
            None => Ok(Url::default()),
        }
    }
}

impl std::fmt::Display for Url {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "udpm://{}:{}?ttl={}", self.group, self.port, self.ttl)?;
        self.recv_buf_size.map_or(Ok(()), |bytes| write!(f, "&recv_buf_size={bytes}"))
    }
}

impl FromStr for Url {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let error = |problem: String| Error::LcmUrl { url: text.to_owned(), problem };
        let rest = text.strip_prefix("udpm://").ok_or_else(|| error("does not start with udpm://".to_owned()))?;
        let (network, options) = rest.split_once('?').unwrap_or((rest, ""));
        let mut url = Url::default();
        if !network.is_empty() {
            let (group, port) = network.split_once(':').unwrap_or((network, ""));
            url.group = group.parse().map_err(|_| error(format!("{group:?} is not an IPv4 address")))?;
            if !port.is_empty() {
                let number = port.parse().ok().filter(|number| *number > 0);
                url.port = number.ok_or_else(|| error(format!("port {port:?}: expected 1 to 65535")))?;
            }
        }
        if !url.group.is_multicast() {
            return Err(error(format!("{} is not a multicast address, 224.0.0.0 to 239.255.255.255", url.group)));
        }
        for option in options.split('&').filter(|option| !option.is_empty()) {
            let (key, value) = option.split_once('=').unwrap_or((option, ""));
            match key {
                "ttl" => url.ttl = value.parse().map_err(|_| error(format!("ttl={value}: expected 0 to 255")))?,
                "recv_buf_size" => {
                    let bytes = value
                        .parse()
                        .map_err(|_| error(format!("recv_buf_size={value}: expected a number of bytes")))?;
                    url.recv_buf_size = Some(bytes);
                }
                _ => return Err(error(format!("unknown option {key:?}; known: ttl, recv_buf_size"))),
            }
        }
        Ok(url)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn urls_parse_as_in_lcm() {
        let parsed = |text: &str| text.parse::<Url>().map(|url| url.to_string()).map_err(|error| error.to_string());
        assert_eq!(parsed("udpm://").unwrap(), "udpm://239.255.76.67:7667?ttl=0");
        assert_eq!(parsed("udpm://239.1.2.3").unwrap(), "udpm://239.1.2.3:7667?ttl=0");
        assert_eq!(
            parsed("udpm://239.1.2.3:80?recv_buf_size=9&ttl=2").unwrap(),
            "udpm://239.1.2.3:80?ttl=2&recv_buf_size=9"
        );
        for (text, part) in [
            ("memq://", "udpm://"),
            ("udpm://robot:7667", "\"robot\""),
            ("udpm://239.1.2.3:x", "\"x\""),
            ("udpm://10.0.0.1:7667", "10.0.0.1"),
            ("udpm://?ttl=300", "ttl=300"),
            ("udpm://?recv_buf_size=much", "recv_buf_size=much"),
            ("udpm://239.1.2.3:0", "port"),
            ("udpm://?tll=1", "\"tll\""),
        ] {
            let Err(Error::LcmUrl { url, problem }) = text.parse::<Url>() else { panic!("{text}: accepted") };
            assert_eq!(url, text);
            assert!(problem.contains(part), "{text}: {problem}");
        }
    }
}
