//! Who may come in: a secret in the address for each role, and only requests that were meant for this program.

use std::net::{IpAddr, SocketAddr};

use axum::http::header::{HOST, ORIGIN};
use axum::http::{HeaderMap, StatusCode};
use subtle::ConstantTimeEq;

use super::super::ConsoleError;

/// Random bytes in a token.
const TOKEN_BYTES: usize = 32;

/// What somebody at a page may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// See everything, and say what is to be done.
    Operator,
    /// Look at what the person is shown.
    Person,
}

impl Role {
    /// The word in addresses.
    pub fn name(self) -> &'static str {
        match self {
            Self::Operator => "operator",
            Self::Person => "person",
        }
    }

    fn parse(name: &str) -> Option<Self> {
        [Self::Operator, Self::Person].into_iter().find(|role| role.name() == name)
    }
}

/// The secrets of the two roles, drawn anew for every run.
#[derive(Clone)]
pub struct Tokens {
    operator: String,
    person: String,
}

impl std::fmt::Debug for Tokens {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("Tokens(..)")
    }
}

impl Tokens {
    /// Draws them from the system's random numbers; a seed would make them guessable.
    ///
    /// # Errors
    /// If the system has none.
    pub fn draw() -> Result<Self, ConsoleError> {
        let token = || -> Result<String, ConsoleError> {
            let mut bytes = [0u8; TOKEN_BYTES];
            getrandom::fill(&mut bytes).map_err(|error| ConsoleError::Random(error.to_string()))?;
            Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
        };
        Ok(Self { operator: token()?, person: token()? })
    }

    /// The secret of a role.
    pub fn of(&self, role: Role) -> &str {
        match role {
            Role::Operator => &self.operator,
            Role::Person => &self.person,
        }
    }
}

/// Why a request is turned away.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// It was sent to another name: a page elsewhere may have made a browser believe that we are it (DNS rebinding).
    #[error("this program is not known under that name")]
    Host,
    /// A page from elsewhere sent it.
    #[error("requests from other pages are not answered")]
    Origin,
    /// It does not know the secret.
    #[error("this address is not known; take the one that the program printed when it started")]
    Token,
}

impl Refusal {
    /// The status that tells it.
    pub fn status(self) -> StatusCode {
        match self {
            Self::Host => StatusCode::MISDIRECTED_REQUEST,
            Self::Origin | Self::Token => StatusCode::FORBIDDEN,
        }
    }
}

/// Checks each request.
#[derive(Debug)]
pub struct AccessControl {
    tokens: Tokens,
    scheme: &'static str,
    /// Names with their port, in small letters, the one to print first.
    hosts: Vec<String>,
}

impl AccessControl {
    /// Lets in who knows the secrets and asks for this address, or one of `names`.
    pub fn new(tokens: Tokens, scheme: &'static str, bound: SocketAddr, names: &[String]) -> Self {
        let port = bound.port();
        let own = (!bound.ip().is_unspecified()).then(|| bound.to_string());
        let local = bound.ip().is_loopback().then(|| format!("localhost:{port}"));
        let default_port = if scheme == "https" { 443 } else { 80 };
        let with_port = |name: &String| match name.parse::<IpAddr>() {
            Ok(IpAddr::V6(ip)) => format!("[{ip}]:{port}"),
            _ => format!("{}:{port}", name.to_ascii_lowercase()),
        };
        let mut hosts: Vec<String> = own.into_iter().chain(local).collect();
        // A certificate is made out to a name, so that a name comes before a number.
        hosts.splice(0..0, names.iter().map(with_port));
        if port == default_port {
            let bare: Vec<String> = hosts
                .iter()
                .filter_map(|host| host.rsplit_once(':'))
                .map(|(name, _)| name.to_owned())
                .collect();
            hosts.extend(bare);
        }
        Self { tokens, scheme, hosts }
    }

    /// The name to print.
    pub fn first_host(&self) -> &str {
        self.hosts.first().map_or("localhost", String::as_str)
    }

    /// Whether a request was meant for this program, and by one of its own pages if by any.
    ///
    /// # Errors
    /// Why not.
    pub fn check_source(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        let mut given = headers.get_all(HOST).iter();
        let host = given.next().and_then(|host| host.to_str().ok()).ok_or(Refusal::Host)?;
        if given.next().is_some() || !self.hosts.contains(&host.to_ascii_lowercase()) {
            return Err(Refusal::Host);
        }
        match headers.get(ORIGIN) {
            None => Ok(()),
            Some(origin) if self.is_own(origin.to_str().unwrap_or_default(), host) => Ok(()),
            Some(_) => Err(Refusal::Origin),
        }
    }

    /// A socket is opened by a page, and a page says where it is from.
    ///
    /// # Errors
    /// If it does not say so.
    pub fn check_socket(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        if headers.contains_key(ORIGIN) { Ok(()) } else { Err(Refusal::Origin) }
    }

    /// The role that a secret stands for. How long this takes does not depend on how much of the secret is right.
    ///
    /// # Errors
    /// If it is not the role's.
    pub fn role(&self, name: &str, token: &str) -> Result<Role, Refusal> {
        let role = Role::parse(name).ok_or(Refusal::Token)?;
        let is_right = self.tokens.of(role).as_bytes().ct_eq(token.as_bytes());
        if is_right.into() { Ok(role) } else { Err(Refusal::Token) }
    }

    fn is_own(&self, origin: &str, host: &str) -> bool {
        let from = origin.strip_prefix(self.scheme).and_then(|rest| rest.strip_prefix("://"));
        from.is_some_and(|from| from.eq_ignore_ascii_case(host))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use axum::http::HeaderValue;

    fn guard(scheme: &'static str, address: &str, names: &[&str]) -> AccessControl {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        AccessControl::new(Tokens::draw().unwrap(), scheme, address.parse().unwrap(), &names)
    }

    fn headers(host: &str, origin: Option<&str>) -> HeaderMap {
        let mut headers = HeaderMap::new();
        headers.insert(HOST, HeaderValue::from_str(host).unwrap());
        if let Some(origin) = origin {
            headers.insert(ORIGIN, HeaderValue::from_str(origin).unwrap());
        }
        headers
    }

    #[test]
    fn tokens_are_long_and_never_the_same() {
        let (one, other) = (Tokens::draw().unwrap(), Tokens::draw().unwrap());
        let all = [one.operator, one.person, other.operator, other.person];
        assert!(all.iter().all(|token| token.len() == 2 * TOKEN_BYTES));
        for (place, token) in all.iter().enumerate() {
            assert!(!all[..place].contains(token));
        }
    }

    #[test]
    fn a_token_opens_its_own_role_and_no_other() {
        let guard = guard("http", "127.0.0.1:8000", &[]);
        let tokens = guard.tokens.clone();
        assert_eq!(guard.role("operator", &tokens.operator), Ok(Role::Operator));
        assert_eq!(guard.role("person", &tokens.person), Ok(Role::Person));
        for (role, token) in [
            ("operator", tokens.person.as_str()),
            ("person", &tokens.operator),
            ("operator", ""),
            ("operator", &tokens.operator[1..]),
            ("Operator", &tokens.operator),
            ("", &tokens.operator),
        ] {
            assert_eq!(guard.role(role, token), Err(Refusal::Token), "{role} {token}");
        }
    }

    #[test]
    fn only_its_own_names_and_its_own_pages_are_answered() {
        let guard = guard("http", "127.0.0.1:8000", &[]);
        for (host, origin) in [
            ("127.0.0.1:8000", None),
            ("localhost:8000", None),
            ("LOCALHOST:8000", Some("http://localhost:8000")),
            ("127.0.0.1:8000", Some("http://127.0.0.1:8000")),
        ] {
            assert_eq!(guard.check_source(&headers(host, origin)), Ok(()), "{host} {origin:?}");
        }
        for (host, origin, refusal) in [
            ("evil.example:8000", None, Refusal::Host),
            ("127.0.0.1", None, Refusal::Host),
            ("127.0.0.1:8001", None, Refusal::Host),
            ("127.0.0.1:8000.evil.example", None, Refusal::Host),
            ("127.0.0.1:8000", Some("http://evil.example"), Refusal::Origin),
            ("127.0.0.1:8000", Some("https://127.0.0.1:8000"), Refusal::Origin),
            ("127.0.0.1:8000", Some("http://localhost:8000"), Refusal::Origin),
            ("127.0.0.1:8000", Some("null"), Refusal::Origin),
        ] {
            assert_eq!(guard.check_source(&headers(host, origin)), Err(refusal), "{host} {origin:?}");
        }
        let mut two = headers("127.0.0.1:8000", None);
        two.append(HOST, HeaderValue::from_static("evil.example"));
        assert_eq!(guard.check_source(&two), Err(Refusal::Host));
        assert_eq!(guard.check_source(&HeaderMap::new()), Err(Refusal::Host));
    }

    #[test]
    fn a_socket_says_which_page_opened_it() {
        let guard = guard("http", "127.0.0.1:8000", &[]);
        assert_eq!(guard.check_socket(&headers("127.0.0.1:8000", None)), Err(Refusal::Origin));
        assert_eq!(guard.check_socket(&headers("127.0.0.1:8000", Some("http://127.0.0.1:8000"))), Ok(()));
    }

    #[test]
    fn on_every_address_only_the_names_given_are_answered() {
        let guard = guard("https", "0.0.0.0:443", &["Console.Lab", "fe80::1"]);
        assert_eq!(guard.first_host(), "console.lab:443");
        for host in ["console.lab:443", "console.lab", "[fe80::1]:443"] {
            assert_eq!(guard.check_source(&headers(host, None)), Ok(()), "{host}");
        }
        for host in ["0.0.0.0:443", "localhost:443", "127.0.0.1:443"] {
            assert_eq!(guard.check_source(&headers(host, None)), Err(Refusal::Host), "{host}");
        }
    }
}
