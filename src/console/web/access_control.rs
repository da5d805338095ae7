//! Access control: a secret token in the address for each role, and protection against forged requests.

use std::net::{IpAddr, SocketAddr};

use axum::http::header::{HOST, ORIGIN};
use axum::http::{HeaderMap, StatusCode};
use subtle::ConstantTimeEq;

use super::super::error::ConsoleError;

/// Random bytes in a token.
const TOKEN_BYTES: usize = 32;

/// Role of a page.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Role {
    /// Sees everything and gives commands.
    Operator,
    /// Sees what the subject is shown, and can ask for nothing.
    Subject,
}

impl Role {
    /// Name of the role in addresses.
    pub fn name(self) -> &'static str {
        match self {
            Self::Operator => "operator",
            Self::Subject => "subject",
        }
    }

    fn parse(name: &str) -> Option<Self> {
        [Self::Operator, Self::Subject].into_iter().find(|role| role.name() == name)
    }
}

/// The secret tokens of the two roles, drawn for every run of the program.
#[derive(Clone)]
pub struct Tokens {
    operator: String,
    subject: String,
}

impl std::fmt::Debug for Tokens {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        out.write_str("Tokens(..)")
    }
}

impl Tokens {
    /// Draws the tokens from the system's random numbers; with a seed they could be guessed.
    ///
    /// # Errors
    /// If the system gives no random numbers.
    pub fn draw() -> Result<Self, ConsoleError> {
        let token = || -> Result<String, ConsoleError> {
            let mut bytes = [0u8; TOKEN_BYTES];
            getrandom::fill(&mut bytes).map_err(|error| ConsoleError::Random(error.to_string()))?;
            Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
        };
        Ok(Self { operator: token()?, subject: token()? })
    }

    /// The token of a role.
    pub fn of(&self, role: Role) -> &str {
        match role {
            Role::Operator => &self.operator,
            Role::Subject => &self.subject,
        }
    }
}

/// Reason why a request is refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// Wrong host name, as after DNS rebinding by another site.
    #[error(
        "the host name is not one of this program; use the address that it printed, or add the name with --host"
    )]
    Host,
    /// The request comes from a page of another site.
    #[error("requests from pages of other sites are refused")]
    Origin,
    /// The token is wrong.
    #[error("the token in the address is wrong; use the address that the program printed when it started")]
    Token,
}

impl Refusal {
    /// HTTP status of the refusal.
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
    /// Accepted host names with port, in lower case; the first one is printed.
    hosts: Vec<String>,
}

impl AccessControl {
    /// Accepts the tokens' owners under the address `bound` and under `names`.
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
        // Names come first because a certificate is valid for a name.
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

    /// Host name to print.
    pub fn first_host(&self) -> &str {
        self.hosts.first().map_or("localhost", String::as_str)
    }

    /// Checks that a request has an accepted host name and does not come from a page of another site.
    ///
    /// # Errors
    /// If the host name or the origin is wrong.
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

    /// Checks that the request for a socket states its origin, as browsers do.
    ///
    /// # Errors
    /// If it states none.
    pub fn check_socket(&self, headers: &HeaderMap) -> Result<(), Refusal> {
        if headers.contains_key(ORIGIN) { Ok(()) } else { Err(Refusal::Origin) }
    }

    /// The role named `name`, if `token` is its token. The comparison takes constant time.
    ///
    /// # Errors
    /// If the role or the token is wrong.
    pub fn role(&self, name: &str, token: &str) -> Result<Role, Refusal> {
        let role = Role::parse(name).ok_or(Refusal::Token)?;
        let is_right = self.tokens.of(role).as_bytes().ct_eq(token.as_bytes());
        if is_right.into() { Ok(role) } else { Err(Refusal::Token) }
    }

    /// The beginning of a request for anything of the operator's page.
    pub fn operators_request(&self) -> String {
        format!("GET /{}/{}/", Role::Operator.name(), self.tokens.of(Role::Operator))
    }

    /// Whether a request that begins with `begin` has the operator's token. The comparison takes constant time.
    pub fn is_operators_request(&self, begin: &[u8]) -> bool {
        self.operators_request().as_bytes().ct_eq(begin).into()
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

    fn access(scheme: &'static str, address: &str, names: &[&str]) -> AccessControl {
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
        let all = [one.operator, one.subject, other.operator, other.subject];
        assert!(all.iter().all(|token| token.len() == 2 * TOKEN_BYTES));
        for (place, token) in all.iter().enumerate() {
            assert!(!all[..place].contains(token));
        }
    }

    #[test]
    fn a_token_opens_its_own_role_and_no_other() {
        let access = access("http", "127.0.0.1:8000", &[]);
        let tokens = access.tokens.clone();
        assert_eq!(access.role("operator", &tokens.operator), Ok(Role::Operator));
        assert_eq!(access.role("subject", &tokens.subject), Ok(Role::Subject));
        for (role, token) in [
            ("operator", tokens.subject.as_str()),
            ("subject", &tokens.operator),
            ("operator", ""),
            ("operator", &tokens.operator[1..]),
            ("Operator", &tokens.operator),
            ("", &tokens.operator),
        ] {
            assert_eq!(access.role(role, token), Err(Refusal::Token), "{role} {token}");
        }
    }

    #[test]
    fn only_the_operators_token_begins_a_request_of_the_operator() {
        let access = access("http", "127.0.0.1:8000", &[]);
        let Tokens { operator, subject } = &access.tokens;
        assert!(access.is_operators_request(format!("GET /operator/{operator}/").as_bytes()));
        for other in [
            format!("GET /operator/{subject}/"),
            format!("GET /subject/{operator}/"),
            format!("GET /operator/{}", &operator[1..]),
            "GET /operator/ HTTP/1.1\r\n".to_owned(),
            String::new(),
        ] {
            assert!(!access.is_operators_request(other.as_bytes()), "{other}");
        }
    }

    #[test]
    fn only_its_own_names_and_its_own_pages_are_answered() {
        let access = access("http", "127.0.0.1:8000", &[]);
        for (host, origin) in [
            ("127.0.0.1:8000", None),
            ("localhost:8000", None),
            ("LOCALHOST:8000", Some("http://localhost:8000")),
            ("127.0.0.1:8000", Some("http://127.0.0.1:8000")),
        ] {
            assert_eq!(access.check_source(&headers(host, origin)), Ok(()), "{host} {origin:?}");
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
            assert_eq!(access.check_source(&headers(host, origin)), Err(refusal), "{host} {origin:?}");
        }
        let mut two = headers("127.0.0.1:8000", None);
        two.append(HOST, HeaderValue::from_static("evil.example"));
        assert_eq!(access.check_source(&two), Err(Refusal::Host));
        assert_eq!(access.check_source(&HeaderMap::new()), Err(Refusal::Host));
    }

    #[test]
    fn a_socket_says_which_page_opened_it() {
        let access = access("http", "127.0.0.1:8000", &[]);
        assert_eq!(access.check_socket(&headers("127.0.0.1:8000", None)), Err(Refusal::Origin));
        assert_eq!(access.check_socket(&headers("127.0.0.1:8000", Some("http://127.0.0.1:8000"))), Ok(()));
    }

    #[test]
    fn on_every_address_only_the_names_given_are_answered() {
        let access = access("https", "0.0.0.0:443", &["Console.Lab", "fe80::1"]);
        assert_eq!(access.first_host(), "console.lab:443");
        for host in ["console.lab:443", "console.lab", "[fe80::1]:443"] {
            assert_eq!(access.check_source(&headers(host, None)), Ok(()), "{host}");
        }
        for host in ["0.0.0.0:443", "localhost:443", "127.0.0.1:443"] {
            assert_eq!(access.check_source(&headers(host, None)), Err(Refusal::Host), "{host}");
        }
    }
}
