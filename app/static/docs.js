/* global SwaggerUIBundle */

const DOCUMENT = document.currentScript.dataset.document;

/**
 * Forms of Swagger UI as a person expects them. It fills each field with an invented value, which would be sent, and
 * takes each text with a media type for a file. Here a field holds its default or nothing, and JSON is typed.
 */
function honestForms(fn) {
  return {
    ...fn,
    getSampleSchema(schema, mediaType, ...more) {
      const isField = mediaType === false && !["array", "object"].includes(schema.get("type"));
      return isField ? (schema.get("default") ?? "") : fn.getSampleSchema(schema, mediaType, ...more);
    },
  };
}

const forms = () => ({
  afterLoad() {
    const isFile = this.fn.isFileUploadIntended;
    this.fn.isFileUploadIntended = (schema, ...more) =>
      schema?.get?.("contentMediaType") !== "application/json" && isFile(schema, ...more);
  },
  wrapComponents: {
    RequestBody: (Original, system) => (props) =>
      system.React.createElement(Original, { ...props, fn: honestForms(props.fn) }),
  },
});

window.ui = SwaggerUIBundle({
  url: DOCUMENT,
  dom_id: "#swagger-ui",
  deepLinking: true,
  presets: [SwaggerUIBundle.presets.apis, SwaggerUIBundle.SwaggerUIStandalonePreset],
  plugins: [forms],
  tryItOutEnabled: true,
  validatorUrl: null,
});
