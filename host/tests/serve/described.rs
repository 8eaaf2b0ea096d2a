//! The OpenAPI document: read by another program's types, and held against what the service does.

use boon::{Compiler, Schemas};
use host::serve::Limits;
use serde_json::{Value, json};

use crate::gated::Running;
use crate::http::{ask, events, get, post, taken};

#[test]
fn the_description_is_openapi_and_has_every_route_and_no_other() {
    let service = Running::with(Limits::default());
    let answer = get(service.address, "/openapi.json");
    assert_eq!(answer.header("content-type"), Some("application/json"));
    let text = String::from_utf8(answer.body).unwrap();
    let typed = oas3::from_json(&text).unwrap();
    typed.validate_version().unwrap();
    let paths = typed.paths.as_ref().unwrap();
    let mut described: Vec<String> = typed
        .operations()
        .map(|(path, method, operation)| {
            let responses = operation.responses.as_ref().unwrap();
            assert!(responses.contains_key("503") && operation.operation_id.is_some(), "{path}");
            format!("{method} {path}")
        })
        .collect();
    described.sort_unstable();
    let routes = [
        "GET /health",
        "GET /openapi.json",
        "GET /plans/{id}",
        "GET /plans/{id}/events",
        "GET /plans/{id}/plan.json",
        "GET /plans/{id}/report",
        "POST /plans",
    ];
    assert_eq!(described, routes);
    let id = taken(&post(service.address, "/plans", b"body"));
    events(service.address, &id);
    let document: Value = serde_json::from_str(&text).unwrap();
    for path in paths.keys() {
        for method in ["GET", "POST", "PUT", "PATCH", "DELETE"] {
            let call = format!("{method} {}", path.replace("{id}", &id));
            let answer = ask(service.address, &call, &[], &[]);
            let operation = &document["paths"][path][method.to_lowercase()];
            assert_eq!(answer.status == 405, operation.is_null(), "{call}: {}", answer.status);
            // What comes is among what is said to come.
            let is_said = !operation["responses"][answer.status.to_string()].is_null();
            assert!(is_said || operation.is_null(), "{call}: {}", answer.status);
        }
    }
}

#[test]
fn documents_are_as_described() {
    let service = Running::with(Limits::default());
    let described = get(service.address, "/openapi.json").json();
    let agrees = |schema: &str, document: &Value| {
        let (mut schemas, mut compiler) = (Schemas::new(), Compiler::new());
        compiler.add_resource("openapi.json", described.clone()).unwrap();
        let at = format!("openapi.json#/components/schemas/{schema}");
        let index = compiler.compile(&at, &mut schemas).unwrap();
        schemas.validate(document, index).map_err(|error| format!("{error:#}"))
    };
    agrees("Health", &get(service.address, "/health").json()).unwrap();
    agrees("Error", &get(service.address, "/nowhere").json()).unwrap();
    agrees("Status", &json!({ "id": "1" })).unwrap_err();
    service.gate.open();
    for word in ["steps", "fail"] {
        let taken_in = post(service.address, &format!("/plans?do={word}"), b"body");
        agrees("Status", &taken_in.json()).unwrap();
        let id = taken(&taken_in);
        for (_, status) in events(service.address, &id) {
            agrees("Status", &status).unwrap();
        }
        agrees("Status", &get(service.address, &format!("/plans/{id}")).json()).unwrap();
    }
}
