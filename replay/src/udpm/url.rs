//! Where an LCM network is.

use crate::Error;
use std::net::Ipv4Addr;
use std::str::FromStr;

/// A network of LCM over UDP multicast.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Url {
    /// Multicast group.
    pub group: Ipv4Addr,
    /// UDP port.
    pub port: u16,
    /// How many routers a message may pass; 0 stays on this machine.
    pub ttl: u8,
    /// Receive buffer asked of the kernel, bytes.
    pub recv_buf_size: Option<usize>,
}

impl Default for Url {
    /// LCM's own default, `udpm://239.255.76.67:7667?ttl=0`.
    fn default() -> Self {
        Url { group: Ipv4Addr::new(239, 255, 76, 67), port: 7667, ttl: 0, recv_buf_size: None }
    }
}

impl Url {
    /// The one given, else that of the environment's `LCM_DEFAULT_URL`, else LCM's default.
    ///
    /// # Errors
    /// [`Error::LcmUrl`] if it is no `udpm://` URL.
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
        let rest = text.strip_prefix("udpm://").ok_or_else(|| error("it does not begin with udpm://".to_owned()))?;
        let (network, options) = rest.split_once('?').unwrap_or((rest, ""));
        let mut url = Url::default();
        if !network.is_empty() {
            let (group, port) = network.split_once(':').unwrap_or((network, ""));
            url.group = group.parse().map_err(|_| error(format!("{group:?} is no IPv4 address")))?;
            if !port.is_empty() {
                url.port = port.parse().map_err(|_| error(format!("{port:?} is no port, 1 to 65535")))?;
            }
        }
        if !url.group.is_multicast() {
            return Err(error(format!("{} is no multicast address, 224.0.0.0 to 239.255.255.255", url.group)));
        }
        for option in options.split('&').filter(|option| !option.is_empty()) {
            let (key, value) = option.split_once('=').unwrap_or((option, ""));
            match key {
                "ttl" => url.ttl = value.parse().map_err(|_| error(format!("ttl={value}: expected 0 to 255")))?,
                "recv_buf_size" => {
                    let bytes = value.parse().map_err(|_| error(format!("recv_buf_size={value}: expected bytes")))?;
                    url.recv_buf_size = Some(bytes);
                }
                _ => return Err(error(format!("option {key:?}, known: ttl, recv_buf_size"))),
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
    fn urls_as_lcm_takes_them() {
        let parsed = |text: &str| text.parse::<Url>().map(|url| url.to_string()).map_err(|error| error.to_string());
        assert_eq!(parsed("udpm://").unwrap(), "udpm://239.255.76.67:7667?ttl=0");
        assert_eq!(parsed("udpm://239.1.2.3").unwrap(), "udpm://239.1.2.3:7667?ttl=0");
        assert_eq!(
            parsed("udpm://239.1.2.3:80?recv_buf_size=9&ttl=2").unwrap(),
            "udpm://239.1.2.3:80?ttl=2&recv_buf_size=9"
        );
        for (text, problem) in [
            ("memq://", "does not begin with udpm://"),
            ("udpm://robot:7667", "\"robot\" is no IPv4 address"),
            ("udpm://239.1.2.3:x", "\"x\" is no port"),
            ("udpm://10.0.0.1:7667", "10.0.0.1 is no multicast address"),
            ("udpm://?ttl=300", "ttl=300: expected 0 to 255"),
            ("udpm://?recv_buf_size=much", "recv_buf_size=much: expected bytes"),
            ("udpm://?tll=1", "option \"tll\", known: ttl, recv_buf_size"),
        ] {
            assert!(parsed(text).unwrap_err().contains(problem), "{:?}", parsed(text));
        }
    }
}
