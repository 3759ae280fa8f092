//! The tests of the page and of its server.

mod browser;
mod chromium;
mod report_pages;
mod server;
mod web;
