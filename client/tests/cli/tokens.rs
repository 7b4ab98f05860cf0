//! `token`, and the token that the client itself shows.
use guardsplat_proto::v1::token::Scope;
use guardsplat_proto::v1::token_service_server::TokenService;
use guardsplat_proto::v1::{
    CreateTokenRequest, CreateTokenResponse, ListTokensRequest, ListTokensResponse, RevokeTokenRequest, Token,
};
use tonic::{Request, Response, Status};

use super::fake::Fake;
use super::run::{TestEnvironment, finish};
use super::services::not_found;

const NAME: &str = "tokens/0190a5d0-0000-7000-8000-00000000000b";
const SECRET: &str = "gst_0190a5d0_5ec2e7";

#[tonic::async_trait]
impl TokenService for Fake {
    async fn create_token(
        &self,
        request: Request<CreateTokenRequest>,
    ) -> Result<Response<CreateTokenResponse>, Status> {
        let mut token = request.into_inner().token.unwrap();
        token.name = NAME.into();
        token.project = "studio".into();
        self.state().tokens.push(token.clone());
        Ok(Response::new(CreateTokenResponse {
            token: Some(token),
            secret: SECRET.into(),
        }))
    }

    async fn list_tokens(&self, _: Request<ListTokensRequest>) -> Result<Response<ListTokensResponse>, Status> {
        Ok(Response::new(ListTokensResponse {
            tokens: self.state().tokens.clone(),
            next_page_token: String::new(),
        }))
    }

    async fn revoke_token(&self, request: Request<RevokeTokenRequest>) -> Result<Response<Token>, Status> {
        let name = request.into_inner().name;
        let time = prost_types::Timestamp { seconds: 0, nanos: 0 };
        let mut state = self.state();
        let token = state.tokens.iter_mut().find(|token| token.name == name);
        let token = token.ok_or_else(|| not_found(&name))?;
        token.revoke_time = Some(time);
        Ok(Response::new(token.clone()))
    }
}

#[test]
fn a_token_is_made_shown_once_and_revoked() {
    let environment = TestEnvironment::new();
    let ran = environment.run("token create --scope embed --scope verify --expires 90d --display-name shop");
    assert_eq!(ran.code, 0, "{}", ran.err);
    // Alone on standard output, so that it can go straight into a file.
    assert_eq!(ran.out, format!("{SECRET}\n"));
    assert!(
        ran.err.contains("embed, verify  ends 2") && !ran.err.contains("5ec2e7"),
        "{}",
        ran.err
    );
    let made = environment.fake.state().tokens[0].clone();
    assert_eq!(made.scopes().collect::<Vec<_>>(), [Scope::Embed, Scope::Verify]);

    let listed = environment.run("token list");
    assert_eq!(listed.out.lines().count(), 1);
    assert!(
        listed.out.starts_with(NAME) && listed.out.contains("shop"),
        "{}",
        listed.out
    );
    let revoked = environment.run(&format!("token revoke {} --json", &NAME[7..])).json();
    assert_eq!(revoked["revoke_time"], "1970-01-01T00:00:00Z");
    assert_eq!(revoked["scopes"], serde_json::json!(["embed", "verify"]));
    assert_eq!(environment.run("token revoke 7").code, 1);
}

#[test]
fn the_client_shows_its_token_and_says_it_nowhere() {
    let environment = TestEnvironment::new();
    environment.file("token", b"gst_1_file\n");
    let command = |line: &str| {
        let mut command = environment.command(line);
        command.env("GUARDSPLAT_SERVER", environment.fake.url());
        command
    };
    let from_file = finish(command("key list --token-file token").spawn().unwrap());
    let mut variable = command("key list --token-file token");
    let from_variable = finish(variable.env("GUARDSPLAT_TOKEN", "gst_2_variable").spawn().unwrap());
    let none = finish(command("key list").spawn().unwrap());
    let shown = environment.fake.state().shown.clone();
    assert_eq!(
        shown,
        [
            Some("Bearer gst_1_file".into()),
            Some("Bearer gst_2_variable".into()),
            None
        ]
    );
    for ran in [from_file, from_variable, none] {
        assert_eq!(ran.code, 0, "{}", ran.err);
        assert!(!ran.out.contains("gst_") && !ran.err.contains("gst_"));
    }
    let mut unset = command("key list");
    for name in [
        "GUARDSPLAT_TOKEN",
        "GUARDSPLAT_TOKEN_FILE",
        "GUARDSPLAT_CA",
        "GUARDSPLAT_CERT",
        "GUARDSPLAT_CERT_KEY",
    ] {
        unset.env(name, "");
    }
    let unset = finish(unset.spawn().unwrap());
    assert_eq!(unset.code, 0, "{}", unset.err);
    let mut bad = command("key list");
    let bad = finish(bad.env("GUARDSPLAT_TOKEN", "5ec2e7 5ec2e7").spawn().unwrap());
    assert_eq!(bad.code, 1);
    assert!(
        bad.err.contains("GUARDSPLAT_TOKEN holds no token") && !bad.err.contains("5ec2e7"),
        "{}",
        bad.err
    );
    let missing = environment.run("key list --token-file nowhere");
    assert!(missing.err.contains("--token-file: nowhere: "), "{}", missing.err);
}
