//! The service described for programs: OpenAPI 3.1 (OpenAPI Initiative, 2021).

use serde_json::{Map, Value, json};

use super::{Limits, OptionInfo};

/// The document. Options are the work's own; limits are those that hold.
pub(super) fn document(options: &[OptionInfo], limits: &Limits) -> Value {
    let id = json!({
        "name": "id", "in": "path", "required": true, "description": "Name of the job, from POST /plans",
        "schema": { "type": "string" },
    });
    let of_job = |operation: &str, summary: &str, media_type: &str, schema: Value, more: &[(&str, &str)]| {
        let mut responses = Map::new();
        responses.insert("200".to_owned(), response(summary, media_type, schema));
        for (status, description) in more.iter().chain(&[("404", "No such plan, or not any more")]) {
            responses.insert((*status).to_owned(), error(description));
        }
        common(&mut responses);
        json!({ "get": { "operationId": operation, "summary": summary, "parameters": [id], "responses": responses } })
    };
    let plain = |operation: &str, summary: &str, schema: Value| {
        let mut responses = Map::new();
        responses.insert("200".to_owned(), response(summary, "application/json", schema));
        common(&mut responses);
        json!({ "get": { "operationId": operation, "summary": summary, "responses": responses } })
    };
    let no_plan = ("409", "Not there yet, or failed; the status says which");
    json!({
        "openapi": "3.1.0",
        "info": {
            "title": "prehend serve",
            "version": env!("CARGO_PKG_VERSION"),
            "description": "Grasps for a mesh or cloud: post it, follow its events, fetch the plan. Errors are one line of JSON that says what to do.",
            "license": { "name": "MIT OR Apache-2.0" },
        },
        "paths": {
            "/health": plain("health", "That the service is there, and how busy it is", reference("Health")),
            "/openapi.json": plain("description", "This document", json!({ "type": "object" })),
            "/plans": { "post": submit(options, limits) },
            "/plans/{id}": of_job("status", "How far a job is", "application/json", reference("Status"), &[]),
            "/plans/{id}/events": of_job(
                "events",
                "Server-sent events, each with a Status as its data: progress, at last done or failed",
                "text/event-stream",
                json!({ "type": "string" }),
                &[],
            ),
            "/plans/{id}/plan.json": of_job(
                "plan",
                "The plan, byte for byte what prehend plan would write; its schema is that of prehend plan --schema",
                "application/json",
                json!({ "type": "object" }),
                &[no_plan],
            ),
            "/plans/{id}/report": of_job(
                "report",
                "The plan as a page for a browser",
                "text/html",
                json!({ "type": "string" }),
                &[no_plan, ("422", "The page cannot be drawn")],
            ),
        },
        "components": { "schemas": schemas() },
    })
}

fn submit(options: &[OptionInfo], limits: &Limits) -> Value {
    let mut responses = Map::new();
    let mut accepted = response("Taken; it waits or runs", "application/json", reference("Status"));
    accepted["headers"] =
        json!({ "Location": { "description": "Address of its status", "schema": { "type": "string" } } });
    responses.insert("202".to_owned(), accepted);
    let too_large = format!("More than {} bytes", limits.body_bytes);
    let too_slow = format!("The body took more than {} s", limits.body_time.as_secs_f64());
    for (status, description) in [
        ("400", "An option is wrong, or there is no body"),
        ("408", too_slow.as_str()),
        ("413", too_large.as_str()),
        ("415", "The content type is not that of a file"),
        ("422", "The body is no mesh or cloud"),
    ] {
        responses.insert(status.to_owned(), error(description));
    }
    let full = format!("{} jobs run and {} wait, as many as may", limits.jobs, limits.queue);
    responses.insert("429".to_owned(), later(&full));
    common(&mut responses);
    let parameters: Vec<Value> = options.iter().map(parameter).collect();
    let file = json!({ "schema": {} });
    json!({
        "operationId": "submit",
        "summary": "Plan grasps on a mesh or cloud",
        "description": "The body is the file itself (PLY, STL, OBJ, OFF, Open Inventor, VRML, PCD, columns). Options are those of prehend plan. A client that sends Expect: 100-continue is refused before it has sent the file.",
        "parameters": parameters,
        "requestBody": {
            "required": false,
            "description": "Left out with option object",
            "content": { "application/octet-stream": file, "model/*": file, "text/plain": file, "text/csv": file },
        },
        "responses": responses,
    })
}

fn parameter(option: &OptionInfo) -> Value {
    let mut schema = json!({ "type": "string" });
    if !option.words.is_empty() {
        schema["enum"] = json!(option.words);
    }
    if let Some(default) = &option.default {
        schema["default"] = json!(default);
    }
    json!({ "name": option.name, "in": "query", "description": option.description, "schema": schema })
}

fn reference(schema: &str) -> Value {
    json!({ "$ref": format!("#/components/schemas/{schema}") })
}

fn response(description: &str, media_type: &str, schema: Value) -> Value {
    json!({ "description": description, "content": { media_type: { "schema": schema } } })
}

fn error(description: &str) -> Value {
    response(description, "application/json", reference("Error"))
}

fn later(description: &str) -> Value {
    let mut response = error(description);
    response["headers"] = json!({
        "Retry-After": { "description": "Seconds until it is worth another try", "schema": { "type": "integer" } },
    });
    response
}

/// Refusals that any request can meet.
fn common(responses: &mut Map<String, Value>) {
    responses.insert("403".to_owned(), error("The page of another site"));
    responses.insert("421".to_owned(), error("Called by a name that is not this machine's own"));
    responses.insert("503".to_owned(), later("Too many clients, or the service is being shut down"));
}

fn schemas() -> Value {
    let count = |description: &str| json!({ "type": "integer", "minimum": 0, "description": description });
    let lines = |description: &str| json!({ "type": "array", "items": { "type": "string" }, "description": description });
    json!({
        "Error": {
            "type": "object",
            "required": ["error"],
            "additionalProperties": false,
            "properties": { "error": { "type": "string", "description": "What is wrong and what to do, one line" } },
        },
        "Health": {
            "type": "object",
            "required": ["name", "version", "waiting", "running", "kept"],
            "additionalProperties": false,
            "properties": {
                "name": { "const": "prehend" },
                "version": { "type": "string", "description": "Version of the program" },
                "waiting": count("Jobs that wait"),
                "running": count("Jobs that run"),
                "kept": count("Jobs that have ended and are kept"),
            },
        },
        "Status": {
            "type": "object",
            "required": [
                "id", "state", "stage", "attempts", "attempts_asked", "grasps", "error", "warnings", "text", "summary",
            ],
            "additionalProperties": false,
            "properties": {
                "id": { "type": "string", "description": "Name of the job" },
                "state": { "enum": ["waiting", "running", "done", "failed"], "description": "How far it is" },
                "stage": { "type": ["string", "null"], "description": "What is being done, while it runs" },
                "attempts": count("Attempts of the search so far"),
                "attempts_asked": count("Most attempts that it will make"),
                "grasps": { "type": ["integer", "null"], "minimum": 0, "description": "Grasps in the plan" },
                "error": { "type": ["string", "null"], "description": "Why there is no plan" },
                "warnings": lines("Doubts about the file that was sent"),
                "text": lines("What was done, for people"),
                "summary": { "type": ["object", "null"], "description": "What was done, as prehend plan --json says it" },
            },
        },
    })
}
