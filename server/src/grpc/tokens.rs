//! `TokenService`: tokens of the caller's project.
use guardsplat_proto::v1;
use guardsplat_proto::v1::token::Scope as Wire;
use guardsplat_proto::v1::token_service_server::TokenService;
use guardsplat_proto::v1::{
    CreateTokenRequest, CreateTokenResponse, ListTokensRequest, ListTokensResponse, RevokeTokenRequest, Token,
};
use secrecy::ExposeSecret;
use tonic::{Request, Response, Status};

use crate::access::{self, Scope, Scopes};
use crate::error::{Error, Result};
use crate::grpc::guard::caller;
use crate::ledger::{NewToken, TokenRow};
use crate::service::clock::{self, timestamp};
use crate::service::names::ResourceKind;
use crate::service::violations::Violations;
use crate::service::{Service, page, text};

#[tonic::async_trait]
impl TokenService for Service {
    async fn create_token(
        &self,
        request: Request<CreateTokenRequest>,
    ) -> Result<Response<CreateTokenResponse>, Status> {
        let caller = caller(&request)?;
        let asked = checked(request.into_inner())?;
        let fresh = access::fresh()?;
        let new = NewToken {
            id: fresh.id,
            hash: fresh.hash,
            display_name: asked.display_name,
            project: caller.project,
            scopes: asked.scopes,
            expire_time: asked.expire_time,
        };
        let row = self
            .ledger()
            .create_token(new, clock::now())
            .await
            .map_err(Error::from)?;
        tracing::info!(token = %row.id, project = row.project, scopes = %row.scopes, by = ?caller.token, "token made");
        Ok(Response::new(CreateTokenResponse {
            token: Some(message(row)),
            secret: fresh.text.expose_secret().to_owned(),
        }))
    }

    async fn list_tokens(&self, request: Request<ListTokensRequest>) -> Result<Response<ListTokensResponse>, Status> {
        let project = caller(&request)?.project;
        let ListTokensRequest { page_size, page_token } = request.into_inner();
        let size = page::size(page_size)?;
        let query: [&[u8]; 2] = [b"tokens", project.as_bytes()];
        let before = page::position(&query, &page_token)?;
        // One more than asked for tells whether there is another page.
        let rows = self.ledger().list_tokens(Some(&project), before, size + 1).await;
        let rows = rows.map_err(Error::from)?;
        let (rows, next_page_token) = page::cut(&query, rows, size, |row| (row.create_time, row.id));
        Ok(Response::new(ListTokensResponse {
            tokens: rows.into_iter().map(message).collect(),
            next_page_token,
        }))
    }

    async fn revoke_token(&self, request: Request<RevokeTokenRequest>) -> Result<Response<Token>, Status> {
        let caller = caller(&request)?;
        let id = ResourceKind::Token.parse("name", &request.get_ref().name)?;
        let row = self.ledger().get_token(id).await.map_err(Error::from)?;
        let own = row.filter(|row| row.project == caller.project);
        own.ok_or_else(|| ResourceKind::Token.not_found(id))?;
        let row = self
            .ledger()
            .revoke_token(id, clock::now())
            .await
            .map_err(Error::from)?;
        tracing::info!(token = %id, project = row.project, by = ?caller.token, "token revoked");
        Ok(Response::new(message(row)))
    }
}

/// A token that may be made.
struct Asked {
    display_name: String,
    scopes: Scopes,
    expire_time: Option<i64>,
}

fn checked(request: CreateTokenRequest) -> Result<Asked> {
    let token = request.token.ok_or_else(|| Error::invalid("token", "is missing"))?;
    let mut problems = Violations::default();
    problems.take(text::display_name("token.display_name", &token.display_name))?;
    let scopes = problems.take(scopes(&token.scopes))?;
    let expire_time = problems.take(token.expire_time.map(end).transpose())?.flatten();
    for (field, empty) in [
        ("token.name", token.name.is_empty()),
        ("token.project", token.project.is_empty()),
        ("token.create_time", token.create_time.is_none()),
        ("token.last_use_time", token.last_use_time.is_none()),
        ("token.revoke_time", token.revoke_time.is_none()),
    ] {
        problems.check(empty, field, "is set by the server and must be empty");
    }
    problems.finish()?;
    Ok(Asked {
        display_name: token.display_name,
        scopes: scopes.unwrap_or_default(), // what is missing was a problem above
        expire_time,
    })
}

fn scopes(given: &[i32]) -> Result<Scopes> {
    const FIELD: &str = "token.scopes";
    if given.is_empty() {
        return Err(Error::invalid(FIELD, "is empty, a token must be good for something"));
    }
    let one = |(i, number): (usize, &i32)| {
        let field = format!("{FIELD}[{i}]");
        match Wire::try_from(*number) {
            Ok(Wire::Embed) => Ok(Scope::Embed),
            Ok(Wire::Verify) => Ok(Scope::Verify),
            Ok(Wire::Admin) => Ok(Scope::Admin),
            // Workers see what all projects send, which no project's administrator may give away.
            Ok(Wire::Worker) => Err(Error::invalid(
                field,
                "tokens for workers are made on the server's machine, by guardsplat-server token create",
            )),
            Ok(Wire::Unspecified) | Err(_) => Err(Error::invalid(field, format!("{number} is no scope"))),
        }
    };
    given.iter().enumerate().map(one).collect()
}

fn end(time: prost_types::Timestamp) -> Result<i64> {
    let end = clock::micros_of(&time).filter(|&end| end > clock::now());
    end.ok_or_else(|| Error::invalid("token.expire_time", "must be a time to come"))
}

fn message(row: TokenRow) -> Token {
    let scope = |scope| match scope {
        Scope::Embed => Wire::Embed,
        Scope::Verify => Wire::Verify,
        Scope::Admin => Wire::Admin,
        Scope::Worker => Wire::Worker,
    };
    v1::Token {
        name: ResourceKind::Token.name(row.id),
        display_name: row.display_name,
        project: row.project,
        scopes: row.scopes.iter().map(|each| scope(each).into()).collect(),
        create_time: Some(timestamp(row.create_time)),
        expire_time: row.expire_time.map(timestamp),
        last_use_time: row.last_use_time.map(timestamp),
        revoke_time: row.revoke_time.map(timestamp),
    }
}
