//! A connection whose received bytes are counted.

use std::io;
use std::pin::Pin;
use std::task::{Context, Poll};
use std::time::Instant;

use tokio::io::{AsyncRead, AsyncWrite, ReadBuf};

use super::limits::{RECEIVED_BYTES, RateLimiter};

/// A connection that ends when the other side sends more bytes than any page does.
#[derive(Debug)]
pub struct Metered<S> {
    stream: S,
    /// What was read from the connection before, and is still to be taken.
    begin: Vec<u8>,
    received: RateLimiter,
}

impl<S> Metered<S> {
    /// A connection of which `begin` has been read.
    pub fn new(stream: S, begin: Vec<u8>) -> Self {
        let [burst, per_s] = RECEIVED_BYTES;
        Self { stream, begin, received: RateLimiter::new(burst, per_s, Instant::now()) }
    }
}

impl<S: AsyncRead + Unpin> AsyncRead for Metered<S> {
    fn poll_read(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        buffer: &mut ReadBuf<'_>,
    ) -> Poll<io::Result<()>> {
        let before = buffer.filled().len();
        let read = if self.begin.is_empty() {
            Pin::new(&mut self.stream).poll_read(context, buffer)
        } else {
            let taken = self.begin.len().min(buffer.remaining());
            buffer.put_slice(&self.begin[..taken]);
            self.begin.drain(..taken);
            Poll::Ready(Ok(()))
        };
        let bytes = buffer.filled().len() - before;
        if bytes > 0 && !self.received.allows_many(bytes as f64, Instant::now()) {
            return Poll::Ready(Err(io::Error::other("more is sent than any page sends")));
        }
        read
    }
}

impl<S: AsyncWrite + Unpin> AsyncWrite for Metered<S> {
    fn poll_write(
        mut self: Pin<&mut Self>,
        context: &mut Context<'_>,
        bytes: &[u8],
    ) -> Poll<io::Result<usize>> {
        Pin::new(&mut self.stream).poll_write(context, bytes)
    }

    fn poll_flush(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_flush(context)
    }

    fn poll_shutdown(mut self: Pin<&mut Self>, context: &mut Context<'_>) -> Poll<io::Result<()>> {
        Pin::new(&mut self.stream).poll_shutdown(context)
    }
}
